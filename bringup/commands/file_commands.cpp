#include "bringup/commands/file_commands.hpp"

#include <dlfcn.h>

#include <algorithm>
#include <filesystem>
#include <string_view>

#include "components/runtime/registry.hpp"

namespace adit {

Result<void> add_file_commands(CLI::App& app, ExitCode& code, int argc, const char* const* argv) {
  std::string file;
  for (const std::string& folder : components::search_path()) {
    file = folder + "/libadit_file_commands.so";
    std::error_code error;
    if (std::filesystem::exists(file, error)) break;
    file.clear();
  }
  if (file.empty()) return {};

  const std::string_view asked = argc > 1 ? argv[1] : "";
  const bool wanted = std::any_of(file_commands::all.begin(), file_commands::all.end(),
                                  [&](const FileCommand& command) { return asked == command.name; });
  if (!wanted) {
    for (const FileCommand& command : file_commands::all) app.add_subcommand(command.name, command.description);
    return {};
  }
  // Never closed: its commands are called by `app`.
  void* const module = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!module) return Error{ErrorCode::unavailable, dlerror()};
  void* const entry = dlsym(module, file_commands::entry_point);
  if (!entry)
    return Error{ErrorCode::incompatible, file + " is not of this build: it has no " + file_commands::entry_point};
  reinterpret_cast<file_commands::EntryPoint*>(entry)(app, code);
  return {};
}

}  // namespace adit
