#include "components/runtime/registry.hpp"

#include <dlfcn.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <mutex>
#include <set>

#include "components/runtime/component.hpp"

namespace adit {
namespace {

struct Registry {
  std::mutex mutex;
  std::map<std::string, ComponentFactory, std::less<>> factories;
};

// Built on first use, because registrations run before main in any order.
Registry& registry() {
  static Registry instance;
  return instance;
}

ComponentFactory find(const std::string& type) {
  const std::lock_guard lock(registry().mutex);
  const auto found = registry().factories.find(type);
  return found == registry().factories.end() ? nullptr : found->second;
}

constexpr std::string_view prefix = "libadit_component_";
constexpr std::string_view suffix = ".so";

bool is_type_name(const std::string& type) {
  return !type.empty() &&
         std::all_of(type.begin(), type.end(), [](unsigned char c) { return std::isalnum(c) || c == '_'; });
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text.empty() ? "none" : text;
}

}  // namespace

ComponentRegistration::ComponentRegistration(std::string_view type, ComponentFactory factory) {
  const std::lock_guard lock(registry().mutex);
  registry().factories.insert_or_assign(std::string(type), factory);
}

namespace components {

std::vector<std::string> search_path() {
  namespace fs = std::filesystem;
  std::vector<std::string> path;
  const auto add = [&path](const fs::path& folder) {
    std::error_code error;
    const std::string text = fs::weakly_canonical(folder, error).string();
    if (!text.empty() && std::find(path.begin(), path.end(), text) == path.end()) path.push_back(text);
  };
  if (const char* const given = std::getenv("ADIT_COMPONENT_PATH")) {
    std::string_view rest = given;
    while (!rest.empty()) {
      const std::size_t end = std::min(rest.find(':'), rest.size());
      if (end > 0) add(rest.substr(0, end));
      rest.remove_prefix(std::min(end + 1, rest.size()));
    }
  }
  std::error_code error;
  if (const fs::path program = fs::read_symlink("/proc/self/exe", error); !error) {
    add(program.parent_path());
    add(program.parent_path() / "../lib");
    add(program.parent_path() / "../lib/adit");
  }
  if (Dl_info info{}; dladdr(reinterpret_cast<const void*>(&search_path), &info) && info.dli_fname) {
    add(fs::absolute(info.dli_fname, error).parent_path());
  }
  return path;
}

std::vector<std::string> available() {
  std::set<std::string> types;
  {
    const std::lock_guard lock(registry().mutex);
    for (const auto& [type, factory] : registry().factories) types.insert(type);
  }
  for (const std::string& folder : search_path()) {
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
      const std::string file = entry.path().filename().string();
      if (!file.starts_with(prefix) || !file.ends_with(suffix)) continue;
      types.insert(file.substr(prefix.size(), file.size() - prefix.size() - suffix.size()));
    }
  }
  return {types.begin(), types.end()};
}

Result<std::unique_ptr<Component>> create(const std::string& type) {
  ComponentFactory factory = find(type);
  const std::vector<std::string> folders = search_path();
  if (!factory && is_type_name(type)) {
    for (const std::string& folder : folders) {
      const std::string file = folder + '/' + std::string(prefix) + type + std::string(suffix);
      std::error_code error;
      if (!std::filesystem::exists(file, error)) continue;
      if (!dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL)) {
        return Error{ErrorCode::unavailable, "component '" + type + "' cannot be loaded: " + dlerror()};
      }
      factory = find(type);
      if (factory) break;
      return Error{ErrorCode::incompatible, file + " registers no component '" + type +
                                                "': its ADIT_COMPONENT(Class, \"" + type + "\") is missing"};
    }
  }
  if (!factory) {
    return Error{ErrorCode::not_found, "unknown component '" + type + "'. Known: " + listed(available()) +
                                           ". Looked for " + std::string(prefix) + type + std::string(suffix) +
                                           " in: " + listed(folders) + " (more with ADIT_COMPONENT_PATH)"};
  }
  try {
    return factory();
  } catch (const std::exception& exception) {
    return Error{ErrorCode::internal, "component '" + type + "' threw while it was built: " + exception.what()};
  }
}

}  // namespace components
}  // namespace adit
