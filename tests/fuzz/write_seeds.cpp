// write_seeds OUT [GOLDEN]: seed corpora OUT/<package>/ for the fuzz targets: a default sample of every type and every
// captured message, each behind the byte that chooses its type.
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>

#include "idl/type_registry.hpp"

namespace fs = std::filesystem;

int main(int argc, char** argv) {
  if (argc < 2) return std::fprintf(stderr, "write_seeds OUT [GOLDEN]\n"), 2;
  int written = 0;
  std::map<std::string, int> index_in_package;
  for (const adit::MessageType& type : adit::all_types()) {
    const std::string name(type.info->ros_name);
    const std::string package = name.substr(0, name.find('/'));
    const std::string short_name = name.substr(name.rfind('/') + 1);
    const char chooser = static_cast<char>(index_in_package[package]++);
    const fs::path folder = fs::path(argv[1]) / package;
    fs::create_directories(folder);
    const auto write = [&](const std::string& file, const char* data, std::size_t size) {
      std::ofstream out(folder / file, std::ios::binary);
      out.put(chooser).write(data, static_cast<std::streamsize>(size));
      ++written;
    };
    const auto sample = type.default_sample();
    write(short_name + std::string(type.variant) + ".default", reinterpret_cast<const char*>(sample.data()),
          sample.size());
    if (argc < 3) continue;
    for (const auto& entry : fs::directory_iterator(argv[2])) {
      const std::string file = entry.path().filename();
      if (!file.starts_with(package + "__" + short_name + ".") || entry.path().extension() != ".cdr") continue;
      std::ifstream in(entry.path(), std::ios::binary);
      const std::string bytes{std::istreambuf_iterator<char>(in), {}};
      write(file + std::string(type.variant), bytes.data(), bytes.size());
    }
  }
  std::printf("%d seeds\n", written);
  return 0;
}
