// What the generator knows of an .idl file: the structs of rosidl-style IDL, and nothing that the C++ side cannot hold.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "idl/generator/syntax_tree.h"

namespace adit::generator {

enum class Kind {
  boolean,
  octet,
  int8,
  uint8,
  int16,
  uint16,
  int32,
  uint32,
  int64,
  uint64,
  float32,
  float64,
  string,
  structure
};
enum class Collection { none, array, sequence, bounded_sequence };

struct Type {
  Kind kind = Kind::boolean;
  std::string structure;  // key of Model::structs, for Kind::structure
  Collection collection = Collection::none;
  std::uint32_t capacity = 0;      // length of an array, bound of a bounded sequence
  std::uint32_t string_bound = 0;  // 0: unbounded
};

struct Value {
  std::string cpp;  // as a C++ literal
  std::string ros;  // as written in a .msg file
};

struct Field {
  std::string name;
  Type type;
  Value default_value;  // empty: zero
};

struct Constant {
  std::string name;
  Kind kind = Kind::int32;
  Value value;
};

struct Struct {
  std::string package;  // "rmw_dds_common"
  std::string module;   // "msg", "srv", "msg_humble": what C++ sees; the wire name drops the suffix
  std::string name;
  std::vector<Constant> constants;
  std::vector<Field> fields;
  bool main = false;  // defined in the file being compiled, not in an included one

  std::string key() const { return package + "::" + module + "::" + name; }
};

struct Model {
  std::string source;                 // the .idl file as given to idlc
  std::vector<std::string> includes;  // every file it includes, directly or not
  std::map<std::string, Struct> structs;
  std::vector<std::string> order;  // keys in order of definition
};

// Reads idlc's syntax tree. IDL that has no C++ counterpart here is reported with its file and line;
// returns false then.
bool read_model(const tree* syntax, Model& model);

}  // namespace adit::generator
