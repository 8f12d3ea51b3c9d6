// Writes the files generated from one .idl file.
#include "idl/generator/backend.h"

#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>

#include "idl/generator/emit.hpp"
#include "idl/generator/model.hpp"

namespace {

namespace fs = std::filesystem;

bool write(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream file(path, std::ios::binary);
  file << text;
  if (file.flush()) return true;
  std::fprintf(stderr, "%s: cannot write\n", path.c_str());
  return false;
}

// For the build tool: the generated files depend on every .idl file read.
std::string dependencies(const fs::path& output, const adit::generator::Model& model) {
  std::string text = output.string() + ".hpp: " + model.source;
  for (const std::string& file : model.includes) text += " " + file;
  return text + '\n';
}

int generate_files(const tree* tree, const fs::path& folder) {
  namespace generator = adit::generator;
  generator::Model model;
  if (!generator::read_model(tree, model)) return -1;
  const std::string stem = generator::output_stem(model);
  if (stem.empty()) {
    std::fprintf(stderr, "%s: no struct in this file\n", model.source.c_str());
    return -1;
  }
  const fs::path output = folder / stem;
  const bool written = write(output.string() + ".hpp", generator::header(model)) &&
                       write(output.string() + ".cpp", generator::source(model)) &&
                       write(output.string() + "_entry.cpp", generator::registry_entry(model)) &&
                       write(output.string() + ".d", dependencies(output, model));
  return written ? 0 : -1;
}

}  // namespace

extern "C" int adit_generate(const tree* tree, const char* output_folder) {
  try {
    return generate_files(tree, output_folder);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return -1;
  }
}
