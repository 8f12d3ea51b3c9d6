#include "idl/generator/syntax_tree.h"

#include <idl/processor.h>

const char* tree_main_file(const tree* tree) {
  return tree->sources->path->name;
}

static const char* included_file(const idl_source_t* source, unsigned* skip) {
  for (const idl_source_t* file = source ? source->includes : 0; file; file = file->next) {
    if ((*skip)-- == 0) return file->path->name;
    const char* nested = included_file(file, skip);
    if (nested) return nested;
  }
  return 0;
}

const char* tree_included_file(const tree* tree, unsigned index) {
  return included_file(tree->sources, &index);
}

node tree_first(const tree* tree) {
  return tree->root;
}

void tree_error(const tree* tree, node at, const char* text) {
  idl_error(tree, idl_location(at), "%s", text);
}

enum node_kind node_kind_of(node any) {
  if (idl_is_module(any)) return node_module;
  if (idl_is_forward(any)) return node_other;
  if (idl_is_struct(any)) return node_struct;
  if (idl_is_const(any)) return node_constant;
  if (idl_is_typedef(any)) return node_typedef;
  if (idl_is_declarator(any)) return node_alias;
  if (idl_is_sequence(any)) return node_sequence;
  switch (idl_type(any)) {
    case IDL_BOOL:
      return node_boolean;
    case IDL_OCTET:
      return node_octet;
    case IDL_CHAR:
      return node_char;
    case IDL_INT8:
      return node_int8;
    case IDL_UINT8:
      return node_uint8;
    case IDL_SHORT:
    case IDL_INT16:
      return node_int16;
    case IDL_USHORT:
    case IDL_UINT16:
      return node_uint16;
    case IDL_LONG:
    case IDL_INT32:
      return node_int32;
    case IDL_ULONG:
    case IDL_UINT32:
      return node_uint32;
    case IDL_LLONG:
    case IDL_INT64:
      return node_int64;
    case IDL_ULLONG:
    case IDL_UINT64:
      return node_uint64;
    case IDL_FLOAT:
      return node_float32;
    case IDL_DOUBLE:
      return node_float64;
    case IDL_LDOUBLE:
      return node_float128;
    case IDL_STRING:
      return !idl_is_literal(any) && idl_is_bounded(any) ? node_bounded_string : node_string;
    default:
      return node_other;
  }
}

const char* node_describe(node any) {
  return idl_construct(any);
}
const char* node_name(node declaration) {
  return idl_identifier(declaration);
}
const char* node_file(node any) {
  return idl_location(any)->first.source->path->name;
}
node node_next(node any) {
  return idl_next(any);
}
node node_parent(node any) {
  return ((const idl_node_t*)any)->parent;
}

node node_first_child(node parent) {
  if (idl_is_module(parent)) return ((const idl_module_t*)parent)->definitions;
  if (idl_is_struct(parent)) return ((const idl_struct_t*)parent)->members;
  if (idl_is_member(parent)) return ((const idl_member_t*)parent)->declarators;
  return 0;
}

node node_type(node typed) {
  return idl_type_spec(typed);
}

node node_literal(node constant_or_member) {
  if (idl_is_member(constant_or_member)) return ((const idl_member_t*)constant_or_member)->value.value;
  const void* value = ((const idl_const_t*)constant_or_member)->const_expr;
  return idl_is_literal(value) ? value : 0;
}

bool struct_inherits(node type) {
  return ((const idl_struct_t*)type)->inherit_spec != 0;
}
bool struct_has_keys(node type) {
  return ((const idl_struct_t*)type)->keylist != 0;
}

const char* member_unsupported_annotation(node member) {
  const idl_member_t* m = member;
  if (m->key.value) return "key";
  if (m->optional.value) return "optional";
  if (m->external.value) return "external";
  return 0;
}

uint32_t sequence_bound(node sequence) {
  return ((const idl_sequence_t*)sequence)->maximum;
}

uint32_t string_bound(node string) {
  return ((const idl_string_t*)string)->maximum;
}

unsigned array_dimensions(node declarator) {
  unsigned count = 0;
  for (node size = ((const idl_declarator_t*)declarator)->const_expr; size; size = idl_next(size)) ++count;
  return count;
}

uint32_t array_first_dimension(node declarator) {
  return ((const idl_literal_t*)((const idl_declarator_t*)declarator)->const_expr)->value.uint32;
}

int64_t literal_signed(node literal) {
  const idl_literal_t* l = literal;
  switch (node_kind_of(literal)) {
    case node_int8:
      return l->value.int8;
    case node_int16:
      return l->value.int16;
    case node_int32:
      return l->value.int32;
    default:
      return l->value.int64;
  }
}

uint64_t literal_unsigned(node literal) {
  const idl_literal_t* l = literal;
  switch (node_kind_of(literal)) {
    case node_boolean:
      return l->value.bln;
    case node_octet:
    case node_uint8:
      return l->value.uint8;
    case node_uint16:
      return l->value.uint16;
    case node_uint32:
      return l->value.uint32;
    default:
      return l->value.uint64;
  }
}

double literal_floating(node literal) {
  const idl_literal_t* l = literal;
  switch (node_kind_of(literal)) {
    case node_float32:
      return l->value.flt;
    case node_float64:
      return l->value.dbl;
    default:
      return (double)l->value.ldbl;
  }
}

const char* literal_string(node literal) {
  return ((const idl_literal_t*)literal)->value.str;
}
