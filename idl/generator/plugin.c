/* What idlc looks for in a back end: `idlc -l <this library> -f case-sensitive -o <output folder> file.idl`. */
#include <idlc/generator.h>

#include "idl/generator/backend.h"

__attribute__((visibility("default"))) int generate(const idl_pstate_t* pstate, const idlc_generator_config_t* config);

int generate(const idl_pstate_t* pstate, const idlc_generator_config_t* config) {
  return adit_generate(pstate, config->output_dir ? config->output_dir : ".");
}
