#include "idl/generator/emit.hpp"

#include <algorithm>
#include <filesystem>
#include <set>

#include "idl/generator/ros_type.hpp"

namespace adit::generator {
namespace {

std::vector<const Struct*> main_structs(const Model& model) {
  std::vector<const Struct*> structs;
  for (const std::string& key : model.order) {
    if (model.structs.at(key).main) structs.push_back(&model.structs.at(key));
  }
  return structs;
}

const char* cpp_primitive(Kind kind) {
  switch (kind) {
    case Kind::boolean:
      return "bool";
    case Kind::octet:
    case Kind::uint8:
      return "std::uint8_t";
    case Kind::int8:
      return "std::int8_t";
    case Kind::int16:
      return "std::int16_t";
    case Kind::uint16:
      return "std::uint16_t";
    case Kind::int32:
      return "std::int32_t";
    case Kind::uint32:
      return "std::uint32_t";
    case Kind::int64:
      return "std::int64_t";
    case Kind::uint64:
      return "std::uint64_t";
    case Kind::float32:
      return "float";
    case Kind::float64:
      return "double";
    case Kind::string:
      return "std::string";
    case Kind::structure:
      break;
  }
  return "";
}

std::string cpp_type(const Type& type) {
  const bool bytes = type.kind == Kind::uint8 || type.kind == Kind::octet;
  std::string element = type.kind == Kind::structure ? "::adit::" + type.structure : cpp_primitive(type.kind);
  if (type.string_bound > 0) element = "::adit::BoundedString<" + std::to_string(type.string_bound) + ">";
  const std::string capacity = std::to_string(type.capacity);
  switch (type.collection) {
    case Collection::none:
      return element;
    case Collection::array:
      return "std::array<" + element + ", " + capacity + ">";
    case Collection::bounded_sequence:
      return "::adit::BoundedVector<" + element + ", " + capacity + ">";
    case Collection::sequence:
      return bytes ? "::adit::Blob" : "std::vector<" + element + ">";
  }
  return element;
}

std::string initializer(const Field& field) {
  if (!field.default_value.cpp.empty()) return " = " + field.default_value.cpp;
  if (field.type.collection == Collection::array) return "{}";
  if (field.type.collection != Collection::none) return "";
  switch (field.type.kind) {
    case Kind::string:
    case Kind::structure:
      return "";
    case Kind::boolean:
      return " = false";
    case Kind::float32:
      return " = 0.0f";
    case Kind::float64:
      return " = 0.0";
    default:
      return " = 0";
  }
}

// A field may be called what C++ reserves; the name in the visitor stays that of the .idl file.
std::string cpp_name(const std::string& name) {
  static const std::set<std::string> reserved = {
      "alignas", "and",      "asm",       "auto",     "bool",     "break",     "case",     "catch",  "char",
      "class",   "concept",  "const",     "continue", "default",  "delete",    "do",       "double", "else",
      "enum",    "explicit", "export",    "extern",   "false",    "float",     "for",      "friend", "goto",
      "if",      "inline",   "int",       "long",     "mutable",  "namespace", "new",      "not",    "operator",
      "or",      "private",  "protected", "public",   "register", "requires",  "return",   "short",  "signed",
      "sizeof",  "static",   "struct",    "switch",   "template", "this",      "throw",    "true",   "try",
      "typedef", "union",    "unsigned",  "using",    "virtual",  "void",      "volatile", "while",  "xor"};
  return reserved.contains(name) ? name + '_' : name;
}

std::string namespace_of(const Struct& type) {
  return "adit::" + type.package + "::" + type.module;
}

std::string struct_text(const Struct& type) {
  std::string out = "struct " + type.name + " {\n";
  for (const Constant& constant : type.constants) {
    const bool text = constant.kind == Kind::string;
    out += "  static constexpr " + std::string(text ? "std::string_view" : cpp_primitive(constant.kind)) + ' ' +
           constant.name + " = " + constant.value.cpp + ";\n";
  }
  if (!type.constants.empty()) out += '\n';
  for (const Field& field : type.fields) {
    out += "  " + cpp_type(field.type) + ' ' + cpp_name(field.name) + initializer(field) + ";\n";
  }
  return out + "\n  bool operator==(const " + type.name + "&) const = default;\n};\n";
}

std::string visitor_text(const Struct& type, const char* qualifier) {
  std::string out = "template <class Visitor>\nvoid for_each_field(" + std::string(qualifier) + type.name +
                    "& message, Visitor&& visit) {\n";
  for (const Field& field : type.fields) {
    out += "  visit(\"" + field.name + "\", message." + cpp_name(field.name) + ");\n";
  }
  return out + "}\n";
}

std::string source_file(const Model& model) {
  const Struct& first = *main_structs(model).front();
  return first.package + '/' + first.module + '/' + std::filesystem::path(model.source).filename().string();
}

std::string banner(const Model& model) {
  return "// Generated from " + source_file(model) + ": do not edit.\n";
}

std::string include_of(const std::string& idl_file) {
  const std::filesystem::path path(idl_file);
  return path.parent_path().parent_path().filename().string() + '/' + path.parent_path().filename().string() + '/' +
         snake_case(path.stem().string()) + ".hpp";
}

}  // namespace

std::string output_stem(const Model& model) {
  const auto structs = main_structs(model);
  if (structs.empty()) return "";
  return structs.front()->package + '/' + structs.front()->module + '/' +
         snake_case(std::filesystem::path(model.source).stem().string());
}

std::string header(const Model& model) {
  std::string out = banner(model) +
                    "#pragma once\n\n#include <array>\n#include <cstdint>\n#include <string>\n#include <vector>\n\n"
                    "#include \"idl/blob.hpp\"\n#include \"idl/bounded.hpp\"\n#include \"idl/codec.hpp\"\n";
  std::set<std::string> includes;
  for (const std::string& file : model.includes) includes.insert(include_of(file));
  for (const std::string& file : includes) out += "#include \"" + file + "\"\n";
  const auto structs = main_structs(model);
  for (const Struct* type : structs) {
    out += "\nnamespace " + namespace_of(*type) + " {\n\n" + struct_text(*type) + '\n' + visitor_text(*type, "") +
           '\n' + visitor_text(*type, "const ") + "\nconstexpr std::size_t minimum_encoded_size(std::type_identity<" +
           type->name + ">) {\n  return " + std::to_string(minimum_size(model, *type)) + ";\n}\n\n}  // namespace " +
           namespace_of(*type) + "\n";
  }
  out += "\nnamespace adit {\n";
  for (const Struct* type : structs) {
    const std::string name = type->key();
    out += "\ntemplate <>\nconst TypeInfo& type_info<" + name + ">();\ntemplate <>\nstd::size_t encoded_size(const " +
           name + "& message);\ntemplate <>\nstd::size_t encode(const " + name +
           "& message, MutableBytes out);\ntemplate <>\nDecodeStatus decode(Bytes payload, " + name +
           "& out, const KeepAlive& keep_alive);\n";
  }
  return out + "\n}  // namespace adit\n";
}

std::string source(const Model& model) {
  std::string out = banner(model) + "#include \"" + output_stem(model) +
                    ".hpp\"\n\n#include \"idl/cdr_codec.hpp\"\n\nnamespace adit {\n";
  for (const Struct* type : main_structs(model)) {
    const std::string name = type->key();
    out += "\ntemplate <>\nconst TypeInfo& type_info<" + name +
           ">() {\n  static constexpr TypeInfo info = {\n      \"" + ros_name(*type) + "\",\n      \"" +
           dds_name(*type) + "\",\n      \"" + type_hash(model, *type) + "\",\n      R\"msg(" + ros2msg(model, *type) +
           ")msg\",\n      " + std::to_string(typical_size(model, *type)) + "};\n  return info;\n}\n";
    out += "\ntemplate <>\nstd::size_t encoded_size(const " + name +
           "& message) {\n  return cdr::encoded_size(message);\n}\n";
    out += "\ntemplate <>\nstd::size_t encode(const " + name +
           "& message, MutableBytes out) {\n  return cdr::encode(message, out);\n}\n";
    out += "\ntemplate <>\nDecodeStatus decode(Bytes payload, " + name +
           "& out, const KeepAlive& keep_alive) {\n  return cdr::decode(payload, out, keep_alive);\n}\n";
  }
  return out + "\n}  // namespace adit\n";
}

std::string registry_entry(const Model& model) {
  const auto structs = main_structs(model);
  const Struct& first = *structs.front();
  const std::string stem = std::filesystem::path(model.source).stem().string();
  std::string out = banner(model) + "#include \"idl/type_entry.hpp\"\n#include \"" + output_stem(model) +
                    ".hpp\"\n\nnamespace adit::registry {\n\nstd::span<const MessageType> types_of_" + first.package +
                    '_' + first.module + '_' + stem + "();\nstd::span<const MessageType> types_of_" + first.package +
                    '_' + first.module + '_' + stem + "() {\n  static const MessageType types[] = {\n";
  for (const Struct* type : structs) {
    const std::size_t suffix = type->module.find('_');
    const std::string variant = suffix == std::string::npos ? "" : type->module.substr(suffix + 1);
    out += "      message_type<::adit::" + type->key() + ">(\"" + variant + "\"),\n";
  }
  return out + "  };\n  return types;\n}\n\n}  // namespace adit::registry\n";
}

}  // namespace adit::generator
