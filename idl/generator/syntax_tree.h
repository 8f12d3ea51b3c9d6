/* The part of idlc's syntax tree that the generator reads. idlc's headers are C that no C++ compiler takes, so they
   stay in syntax_tree.c. Nodes belong to idlc and live until the back end returns. */
#ifndef ADIT_IDL_GENERATOR_SYNTAX_TREE_H
#define ADIT_IDL_GENERATOR_SYNTAX_TREE_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

struct idl_pstate;
typedef struct idl_pstate tree;
typedef const void* node;

enum node_kind {
  node_module,
  node_struct,
  node_constant,
  node_typedef,
  node_alias, /* a typedef's name used as a type */
  node_sequence,
  node_boolean,
  node_octet,
  node_char,
  node_int8,
  node_uint8,
  node_int16,
  node_uint16,
  node_int32,
  node_uint32,
  node_int64,
  node_uint64,
  node_float32,
  node_float64,
  node_float128,
  node_string,
  node_bounded_string,
  node_other,
};

/* Files: the one given to idlc, then every included one (0 after the last; a file may come twice). */
const char* tree_main_file(const tree* tree);
const char* tree_included_file(const tree* tree, unsigned index);
node tree_first(const tree* tree);
/* Reports `text` with the place of the node: "file:line:column: text". */
void tree_error(const tree* tree, node at, const char* text);

enum node_kind node_kind_of(node any);
const char* node_describe(node any);
const char* node_name(node declaration);
const char* node_file(node any);
node node_next(node any);
node node_parent(node any);
/* Definitions of a module, members of a struct, declarators of a member. */
node node_first_child(node parent);
/* Type of a member, constant, alias, or of a sequence's elements. */
node node_type(node typed);
/* Value of a constant, @default of a member (0: none). A literal's kind is that of its value. */
node node_literal(node constant_or_member);

bool struct_inherits(node type);
bool struct_has_keys(node type);
/* Name of an annotation that changes the wire format: "key", "optional", "external"; 0: none. */
const char* member_unsupported_annotation(node member);
uint32_t sequence_bound(node sequence); /* 0: unbounded */
uint32_t string_bound(node string);
unsigned array_dimensions(node declarator); /* 0: not an array */
uint32_t array_first_dimension(node declarator);

int64_t literal_signed(node literal);
uint64_t literal_unsigned(node literal);
double literal_floating(node literal);
const char* literal_string(node literal);

#ifdef __cplusplus
}
#endif

#endif
