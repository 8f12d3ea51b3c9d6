#include "idl/generator/model.hpp"

#include <charconv>
#include <limits>
#include <optional>
#include <set>

namespace adit::generator {
namespace {

constexpr std::string_view constants_suffix = "_Constants";

template <class Number>
std::string text_of(Number number) {
  char buffer[64];
  return {buffer, std::to_chars(buffer, buffer + sizeof buffer, number).ptr};
}

template <class Number>
Value floating_value(Number number, const char* suffix) {
  std::string text = text_of(number);
  Value value{text, text};
  if (text.find_first_of(".en") == std::string::npos) value.cpp += ".0";
  value.cpp += suffix;
  return value;
}

Value integer_value(std::int64_t number) {
  const std::string text = text_of(number);
  // The most negative number is no C++ literal: its digits are read first and do not fit.
  if (number == std::numeric_limits<std::int64_t>::min()) return {"(-9223372036854775807 - 1)", text};
  return {text, text};
}

Value integer_value(std::uint64_t number) {
  const std::string text = text_of(number);
  return {number > std::numeric_limits<std::int64_t>::max() ? text + "u" : text, text};
}

std::string quoted(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + '"';
}

class Reader {
 public:
  Reader(const tree* syntax, Model& model) : tree_(syntax), model_(model) {}

  bool read() {
    model_.source = tree_main_file(tree_);
    std::set<std::string> seen;
    for (unsigned i = 0; const char* file = tree_included_file(tree_, i); ++i) {
      if (seen.insert(file).second) model_.includes.emplace_back(file);
    }
    std::vector<std::string> scope;
    read_definitions(tree_first(tree_), scope);
    attach_constants();
    return ok_;
  }

 private:
  void error(node at, const std::string& text) {
    tree_error(tree_, at, text.c_str());
    ok_ = false;
  }

  void read_definitions(node first, std::vector<std::string>& scope) {
    for (node definition = first; definition; definition = node_next(definition)) {
      switch (node_kind_of(definition)) {
        case node_module:
          scope.emplace_back(node_name(definition));
          read_definitions(node_first_child(definition), scope);
          scope.pop_back();
          break;
        case node_struct:
          read_struct(definition, scope);
          break;
        case node_constant:
          read_constant(definition, scope);
          break;
        case node_typedef:
          break;  // resolved where it is used
        default:
          error(definition, std::string(node_describe(definition)) +
                                " is not supported: a message is made of structs, constants and typedefs");
      }
    }
  }

  void read_struct(node definition, const std::vector<std::string>& scope) {
    const std::string name = node_name(definition);
    if (scope.size() != 2) {
      return error(definition, "struct " + name + " must stand in two modules, package and msg (or srv)");
    }
    Struct result{scope[0], scope[1], name, {}, {}, model_.source == node_file(definition)};
    if (struct_inherits(definition)) error(definition, "struct " + name + ": inheritance is not supported");
    if (struct_has_keys(definition)) error(definition, "struct " + name + ": keys are not supported");
    for (node member = node_first_child(definition); member; member = node_next(member)) read_member(member, result);
    if (result.fields.empty() && ok_) {
      error(definition, "struct " + name + " has no member; ROS gives it: uint8 structure_needs_at_least_one_member");
    }
    const std::string key = result.key();
    model_.order.push_back(key);
    model_.structs.emplace(key, std::move(result));
  }

  void read_member(node member, Struct& result) {
    if (const char* annotation = member_unsupported_annotation(member)) {
      return error(member, "@" + std::string(annotation) + " is not supported");
    }
    for (node declarator = node_first_child(member); declarator; declarator = node_next(declarator)) {
      Field field{node_name(declarator), {}, {}};
      const auto type = read_type(node_type(member), declarator);
      if (!type) return;
      field.type = *type;
      if (const node literal = node_literal(member)) {
        if (type->collection != Collection::none || type->kind == Kind::structure) {
          return error(member, "@default is supported for a single number, boolean or string");
        }
        const auto value = read_literal(literal, type->kind, member);
        if (!value) return;
        field.default_value = *value;
      }
      result.fields.push_back(std::move(field));
    }
  }

  // The type of a declarator: `double x`, `double x[3]`, `sequence<double> x`, through typedefs of any of them.
  std::optional<Type> read_type(node type_spec, node declarator) {
    const std::string name = node_name(declarator);
    Type type;
    if (!read_array(declarator, declarator, type)) return {};
    for (; node_kind_of(type_spec) == node_alias; type_spec = node_type(type_spec)) {
      if (!read_array(type_spec, declarator, type)) return {};
    }
    if (node_kind_of(type_spec) == node_sequence) {
      if (type.collection != Collection::none) {
        error(declarator, name + ": an array of sequences is not supported");
        return {};
      }
      type.capacity = sequence_bound(type_spec);
      type.collection = type.capacity > 0 ? Collection::bounded_sequence : Collection::sequence;
      type_spec = node_type(type_spec);
      while (node_kind_of(type_spec) == node_alias && array_dimensions(type_spec) == 0)
        type_spec = node_type(type_spec);
      if (node_kind_of(type_spec) == node_sequence || node_kind_of(type_spec) == node_alias) {
        error(declarator, name + ": a sequence of sequences or arrays is not supported");
        return {};
      }
    }
    const auto kind = read_kind(type_spec, declarator);
    if (!kind) return {};
    type.kind = *kind;
    if (*kind == Kind::structure) type.structure = structure_key(type_spec);
    if (node_kind_of(type_spec) == node_bounded_string) type.string_bound = string_bound(type_spec);
    return type;
  }

  bool read_array(node maybe_array, node declarator, Type& type) {
    const unsigned dimensions = array_dimensions(maybe_array);
    if (dimensions == 0) return true;
    if (dimensions > 1 || type.collection == Collection::array) {
      error(declarator, std::string(node_name(declarator)) + ": an array has one dimension");
      return false;
    }
    type.collection = Collection::array;
    type.capacity = array_first_dimension(maybe_array);
    return true;
  }

  std::optional<Kind> read_kind(node type_spec, node place) {
    switch (node_kind_of(type_spec)) {
      case node_struct:
        return Kind::structure;
      case node_boolean:
        return Kind::boolean;
      case node_octet:
        return Kind::octet;
      case node_int8:
        return Kind::int8;
      case node_uint8:
        return Kind::uint8;
      case node_int16:
        return Kind::int16;
      case node_uint16:
        return Kind::uint16;
      case node_int32:
        return Kind::int32;
      case node_uint32:
        return Kind::uint32;
      case node_int64:
        return Kind::int64;
      case node_uint64:
        return Kind::uint64;
      case node_float32:
        return Kind::float32;
      case node_float64:
        return Kind::float64;
      case node_string:
      case node_bounded_string:
        return Kind::string;
      case node_char:
        error(place, "char is not supported: use uint8, as ROS does");
        return {};
      default:
        error(place, std::string(node_describe(type_spec)) + " is not supported as the type of a member");
        return {};
    }
  }

  static std::string structure_key(node type) {
    std::string key = node_name(type);
    for (node up = node_parent(type); up; up = node_parent(up)) {
      if (node_kind_of(up) == node_module) key = std::string(node_name(up)) + "::" + key;
    }
    return key;
  }

  void read_constant(node constant, const std::vector<std::string>& scope) {
    const std::string name = node_name(constant);
    if (scope.size() != 3 || !scope[2].ends_with(constants_suffix)) {
      return error(constant, "constant " + name + " must stand in a module named <Struct>_Constants");
    }
    const node literal = node_literal(constant);
    if (!literal) return error(constant, "constant " + name + ": only numbers, booleans and strings");
    node type_spec = node_type(constant);
    while (node_kind_of(type_spec) == node_alias) type_spec = node_type(type_spec);
    const auto kind = read_kind(type_spec, constant);
    if (!kind) return;
    const auto value = read_literal(literal, *kind, constant);
    if (!value) return;
    const std::string owner = scope[2].substr(0, scope[2].size() - constants_suffix.size());
    constants_.push_back({scope[0] + "::" + scope[1] + "::" + owner, {name, *kind, *value}, constant});
  }

  // idlc has checked a constant against its type; the literal of a @default keeps the type it was written in.
  std::optional<Value> read_literal(node literal, Kind wanted, node place) {
    const node_kind written = node_kind_of(literal);
    const bool floating = written == node_float32 || written == node_float64 || written == node_float128;
    const bool is_signed =
        written == node_int8 || written == node_int16 || written == node_int32 || written == node_int64;
    const bool integer = !floating && written != node_boolean && written != node_string && written != node_other;
    std::optional<Value> value;
    if (wanted == Kind::string) {
      if (written == node_string) value = Value{quoted(literal_string(literal)), quoted(literal_string(literal))};
    } else if (wanted == Kind::boolean) {
      const char* text = written == node_boolean && literal_unsigned(literal) ? "true" : "false";
      if (written == node_boolean) value = Value{text, text};
    } else if (wanted == Kind::float32 || wanted == Kind::float64) {
      double number = 0.0;
      if (floating)
        number = literal_floating(literal);
      else if (is_signed)
        number = static_cast<double>(literal_signed(literal));
      else
        number = static_cast<double>(literal_unsigned(literal));
      if (floating || integer) {
        value = wanted == Kind::float32 ? floating_value(static_cast<float>(number), "f") : floating_value(number, "");
      }
    } else if (integer) {
      value = is_signed ? integer_value(literal_signed(literal)) : integer_value(literal_unsigned(literal));
    }
    if (!value) error(place, "the value does not fit its type");
    return value;
  }

  void attach_constants() {
    for (PlacedConstant& constant : constants_) {
      const auto owner = model_.structs.find(constant.owner);
      if (owner == model_.structs.end()) {
        error(constant.at, "there is no struct " + constant.owner + " for these constants");
      } else {
        owner->second.constants.push_back(std::move(constant.constant));
      }
    }
  }

  struct PlacedConstant {
    std::string owner;
    Constant constant;
    node at;
  };

  const tree* tree_;
  Model& model_;
  std::vector<PlacedConstant> constants_;
  bool ok_ = true;
};

}  // namespace

bool read_model(const tree* syntax, Model& model) {
  return Reader(syntax, model).read();
}

}  // namespace adit::generator
