#ifndef ADIT_IDL_GENERATOR_BACKEND_H
#define ADIT_IDL_GENERATOR_BACKEND_H

#include "idl/generator/syntax_tree.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Writes the C++ of the main file of `tree` below `output_folder`. 0: done; otherwise the reason has been printed. */
int adit_generate(const tree* tree, const char* output_folder);

#ifdef __cplusplus
}
#endif

#endif
