#include "idl/generator/ros_type.hpp"

#include <algorithm>
#include <cctype>
#include <set>

#include "idl/generator/sha256.hpp"

namespace adit::generator {
namespace {

constexpr const char* empty_struct_member = "structure_needs_at_least_one_member";

// type_description_interfaces/msg/FieldType.
int field_type_id(const Type& type) {
  int id = 0;
  switch (type.kind) {
    case Kind::structure:
      id = 1;
      break;
    case Kind::int8:
      id = 2;
      break;
    case Kind::uint8:
      id = 3;
      break;
    case Kind::int16:
      id = 4;
      break;
    case Kind::uint16:
      id = 5;
      break;
    case Kind::int32:
      id = 6;
      break;
    case Kind::uint32:
      id = 7;
      break;
    case Kind::int64:
      id = 8;
      break;
    case Kind::uint64:
      id = 9;
      break;
    case Kind::float32:
      id = 10;
      break;
    case Kind::float64:
      id = 11;
      break;
    case Kind::boolean:
      id = 15;
      break;
    case Kind::octet:
      id = 16;
      break;
    case Kind::string:
      id = type.string_bound > 0 ? 21 : 17;
      break;
  }
  switch (type.collection) {
    case Collection::none:
      return id;
    case Collection::array:
      return id + 48;
    case Collection::bounded_sequence:
      return id + 96;
    case Collection::sequence:
      return id + 144;
  }
  return id;
}

const char* ros_primitive(Kind kind) {
  switch (kind) {
    case Kind::boolean:
      return "bool";
    case Kind::octet:
      return "byte";
    case Kind::int8:
      return "int8";
    case Kind::uint8:
      return "uint8";
    case Kind::int16:
      return "int16";
    case Kind::uint16:
      return "uint16";
    case Kind::int32:
      return "int32";
    case Kind::uint32:
      return "uint32";
    case Kind::int64:
      return "int64";
    case Kind::uint64:
      return "uint64";
    case Kind::float32:
      return "float32";
    case Kind::float64:
      return "float64";
    case Kind::string:
      return "string";
    case Kind::structure:
      break;
  }
  return "";
}

// "msg_humble" and "msg" are the same on the wire.
std::string wire_module(const Struct& type) {
  return type.module.substr(0, type.module.find('_'));
}

std::string type_description(const Model& model, const Struct& type) {
  std::string json = "{\"type_name\": \"" + ros_name(type) + "\", \"fields\": [";
  for (std::size_t i = 0; i < type.fields.size(); ++i) {
    const Field& field = type.fields[i];
    const bool nested = field.type.kind == Kind::structure;
    if (i > 0) json += ", ";
    json += "{\"name\": \"" + field.name + "\", \"type\": {\"type_id\": " + std::to_string(field_type_id(field.type)) +
            ", \"capacity\": " + std::to_string(field.type.capacity) +
            ", \"string_capacity\": " + std::to_string(field.type.string_bound) + ", \"nested_type_name\": \"" +
            (nested ? ros_name(model.structs.at(field.type.structure)) : "") + "\"}}";
  }
  return json + "]}";
}

// Keys of the structs in `type`, at any depth, each once, in the order they are met.
void collect(const Model& model, const Struct& type, std::vector<std::string>& keys) {
  for (const Field& field : type.fields) {
    if (field.type.kind != Kind::structure) continue;
    if (std::find(keys.begin(), keys.end(), field.type.structure) != keys.end()) continue;
    keys.push_back(field.type.structure);
    collect(model, model.structs.at(field.type.structure), keys);
  }
}

std::string msg_text(const Model& model, const Struct& type) {
  std::string text;
  for (const Constant& constant : type.constants) {
    text += std::string(ros_primitive(constant.kind)) + ' ' + constant.name + '=' + constant.value.ros + '\n';
  }
  for (const Field& field : type.fields) {
    if (field.name == empty_struct_member) continue;
    if (field.type.kind == Kind::structure) {
      const Struct& nested = model.structs.at(field.type.structure);
      text += nested.package + '/' + nested.name;
    } else {
      text += ros_primitive(field.type.kind);
      if (field.type.string_bound > 0) text += "<=" + std::to_string(field.type.string_bound);
    }
    const std::string capacity = std::to_string(field.type.capacity);
    if (field.type.collection == Collection::array) text += '[' + capacity + ']';
    if (field.type.collection == Collection::sequence) text += "[]";
    if (field.type.collection == Collection::bounded_sequence) text += "[<=" + capacity + ']';
    text += ' ' + field.name;
    if (!field.default_value.ros.empty()) text += ' ' + field.default_value.ros;
    text += '\n';
  }
  return text;
}

std::size_t primitive_size(Kind kind) {
  switch (kind) {
    case Kind::boolean:
    case Kind::octet:
    case Kind::int8:
    case Kind::uint8:
      return 1;
    case Kind::int16:
    case Kind::uint16:
      return 2;
    case Kind::int32:
    case Kind::uint32:
    case Kind::float32:
    case Kind::string:
      return 4;  // a string is at least its length
    case Kind::int64:
    case Kind::uint64:
    case Kind::float64:
      return 8;
    case Kind::structure:
      break;
  }
  return 0;
}

}  // namespace

std::string ros_name(const Struct& type) {
  return type.package + '/' + wire_module(type) + '/' + type.name;
}

std::string dds_name(const Struct& type) {
  return type.package + "::" + wire_module(type) + "::dds_::" + type.name + '_';
}

std::string type_hash(const Model& model, const Struct& type) {
  std::vector<std::string> keys;
  collect(model, type, keys);
  std::sort(keys.begin(), keys.end(), [&](const std::string& a, const std::string& b) {
    return ros_name(model.structs.at(a)) < ros_name(model.structs.at(b));
  });
  std::string json =
      "{\"type_description\": " + type_description(model, type) + ", \"referenced_type_descriptions\": [";
  for (std::size_t i = 0; i < keys.size(); ++i) {
    if (i > 0) json += ", ";
    json += type_description(model, model.structs.at(keys[i]));
  }
  return "RIHS01_" + sha256_hex(json + "]}");
}

std::string ros2msg(const Model& model, const Struct& type) {
  std::vector<std::string> keys;
  collect(model, type, keys);
  std::string text = msg_text(model, type);
  for (const std::string& key : keys) {
    const Struct& nested = model.structs.at(key);
    text += std::string(80, '=') + "\nMSG: " + nested.package + '/' + nested.name + '\n' + msg_text(model, nested);
  }
  return text;
}

std::size_t minimum_size(const Model& model, const Struct& type) {
  std::size_t size = 0;
  for (const Field& field : type.fields) {
    std::size_t element = 4;  // a sequence is at least its length
    if (field.type.collection == Collection::none || field.type.collection == Collection::array) {
      element = field.type.kind == Kind::structure ? minimum_size(model, model.structs.at(field.type.structure))
                                                   : primitive_size(field.type.kind);
    }
    size += element * (field.type.collection == Collection::array ? field.type.capacity : 1);
  }
  return size;
}

std::size_t typical_size(const Model& model, const Struct& type) {
  constexpr std::size_t string_length = 16;
  constexpr std::size_t sequence_length = 8;
  constexpr std::size_t image_bytes = 1 << 20;
  std::size_t size = 0;
  for (const Field& field : type.fields) {
    std::size_t element = primitive_size(field.type.kind);
    if (field.type.kind == Kind::structure) element = typical_size(model, model.structs.at(field.type.structure));
    if (field.type.kind == Kind::string) element += string_length;
    switch (field.type.collection) {
      case Collection::none:
        size += element;
        break;
      case Collection::array:
        size += element * field.type.capacity;
        break;
      case Collection::bounded_sequence:
      case Collection::sequence: {
        const bool image = field.type.kind == Kind::uint8 && field.name == "data";
        size += 4 + (image ? image_bytes : element * sequence_length);
      }
    }
  }
  return size;
}

std::string snake_case(const std::string& name) {
  const auto upper = [&](std::size_t i) {
    return i < name.size() && std::isupper(static_cast<unsigned char>(name[i]));
  };
  const auto lower = [&](std::size_t i) {
    return i < name.size() && std::islower(static_cast<unsigned char>(name[i]));
  };
  std::string out;
  for (std::size_t i = 0; i < name.size(); ++i) {
    const bool starts_word = i > 0 && upper(i) && name[i - 1] != '_' && (lower(i + 1) || !upper(i - 1));
    if (starts_word) out += '_';
    out += static_cast<char>(std::tolower(static_cast<unsigned char>(name[i])));
  }
  return out;
}

}  // namespace adit::generator
