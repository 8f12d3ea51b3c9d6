// From a vendor's name to an open participant.
#include <dlfcn.h>

#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <sstream>

#include "middleware/ros/ros_participant.hpp"
#include "middleware/vendor.hpp"

#ifdef ADIT_STATIC_VENDORS
#ifdef ADIT_HAS_fastdds
extern "C" const adit::VendorModule* adit_vendor_module_fastdds();
#endif
#ifdef ADIT_HAS_cyclonedds
extern "C" const adit::VendorModule* adit_vendor_module_cyclonedds();
#endif
#endif

namespace adit {
namespace {

constexpr std::uint32_t max_domain = 232;  // RTPS 2.2, 9.6.1.1: ports of higher domains do not fit 16 bits

struct Vendor {
  std::string_view name;
  VendorEntryPoint entry;  // null: in a shared module
};

constexpr Vendor vendors[] = {
#ifdef ADIT_STATIC_VENDORS
#ifdef ADIT_HAS_fastdds
    {"fastdds", &adit_vendor_module_fastdds},
#endif
#ifdef ADIT_HAS_cyclonedds
    {"cyclonedds", &adit_vendor_module_cyclonedds},
#endif
#else
#ifdef ADIT_HAS_fastdds
    {"fastdds", nullptr},
#endif
#ifdef ADIT_HAS_cyclonedds
    {"cyclonedds", nullptr},
#endif
#endif
    {"", nullptr},  // ends the list, which may be empty otherwise
};
constexpr std::size_t vendor_count = std::size(vendors) - 1;

std::string quoted(std::string_view name) {
  return "'" + std::string(name) + "'";
}

std::string built_in_list() {
  std::string list;
  for (const auto name : built_in_vendors()) list += (list.empty() ? "" : ", ") + std::string(name);
  return list.empty() ? "none" : list;
}

// Next to this library (build tree, package), else where this build installs to.
Result<void*> open_module(std::string_view name) {
  const std::string file = "libadit_middleware_" + std::string(name) + ".so";
  std::vector<std::filesystem::path> places;
  Dl_info self{};
  if (dladdr(reinterpret_cast<const void*>(&built_in_vendors), &self) && self.dli_fname) {
    std::error_code ignored;
    const auto absolute = std::filesystem::absolute(self.dli_fname, ignored);
    places.push_back(absolute.parent_path());
  }
  places.emplace_back(ADIT_MODULE_FOLDER);

  std::string tried;
  for (const auto& place : places) {
    const auto path = place / file;
    std::error_code ignored;
    if (!std::filesystem::exists(path, ignored)) {
      tried += "\n  " + path.string() + ": no such file";
      continue;
    }
    if (void* module = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL)) return module;
    const char* why = dlerror();
    tried += "\n  " + path.string() + ": " + (why ? why : "unknown reason");
  }
  return Error{ErrorCode::unavailable, "middleware " + quoted(name) + " belongs to this build, but its module " + file +
                                           " cannot be loaded; install it next to libadit_middleware.so, together "
                                           "with the vendor's library. Tried:" +
                                           tried};
}

Result<const VendorModule*> load(const Vendor& vendor) {
  if (vendor.entry) return vendor.entry();
  const auto module = open_module(vendor.name);
  if (!module) return module.error();
  // The module is never closed: samples and threads of the vendor may live as long as the process.
  if (void* symbol = dlsym(*module, vendor_entry_point)) return reinterpret_cast<VendorEntryPoint>(symbol)();
  return Error{ErrorCode::incompatible, "libadit_middleware_" + std::string(vendor.name) +
                                            ".so is no vendor module (no " + vendor_entry_point +
                                            "): install the one of this build"};
}

}  // namespace

std::span<const std::string_view> built_in_vendors() {
  static const auto names = [] {
    std::array<std::string_view, vendor_count + 1> all{};
    for (std::size_t i = 0; i < vendor_count; ++i) all[i] = vendors[i].name;
    return all;
  }();
  return {names.data(), vendor_count};
}

std::vector<std::string> warnings_in(const std::string& explanation) {
  std::vector<std::string> warnings;
  std::istringstream lines(explanation);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string first, rest;
    words >> first;
    if (first != "warning" && first != "warning:") continue;
    std::getline(words >> std::ws, rest);
    warnings.push_back(rest);
  }
  return warnings;
}

Result<const VendorModule*> load_vendor(std::string_view name) {
  if (name != "fastdds" && name != "cyclonedds") {
    return Error{ErrorCode::not_found,
                 "unknown middleware " + quoted(name) + ": use one of those built in (" + built_in_list() + ")"};
  }
  for (std::size_t i = 0; i < vendor_count; ++i) {
    if (vendors[i].name != name) continue;
    static std::mutex mutex;
    static const VendorModule* loaded[vendor_count + 1] = {};
    const std::lock_guard lock(mutex);
    if (!loaded[i]) {
      const auto module = load(vendors[i]);
      if (!module) return module.error();
      loaded[i] = *module;
    }
    return loaded[i];
  }
  return Error{ErrorCode::unavailable, "middleware " + quoted(name) + " is not built in: use one of those that are (" +
                                           built_in_list() + "), or build with -DADIT_MIDDLEWARE=" + std::string(name)};
}

Result<std::unique_ptr<Participant>> open(const ParticipantConfig& config) {
  ParticipantConfig resolved = config;
  if (resolved.vendor.empty()) {
    if (const char* wanted = std::getenv("ADIT_MIDDLEWARE")) resolved.vendor = wanted;
  }
  if (resolved.vendor.empty()) {
    if (built_in_vendors().empty()) {
      return Error{ErrorCode::unavailable, "no middleware is built in: build with -DADIT_MIDDLEWARE=fastdds"};
    }
    resolved.vendor = built_in_vendors().front();
  }
  if (resolved.domain > max_domain) {
    return Error{ErrorCode::invalid_argument, "domain " + std::to_string(resolved.domain) +
                                                  " is out of range: use 0 to " + std::to_string(max_domain)};
  }
  const auto vendor = load_vendor(resolved.vendor);
  if (!vendor) return vendor.error();
  if (Result<void> valid = validate_ros_distro(resolved.ros_distro); !valid) return valid.error();

  Result<std::unique_ptr<Participant>> participant = (*vendor)->open(resolved, ros_participant_user_data(resolved));
  if (!participant) return participant;
  return make_ros_participant(*std::move(participant));
}

}  // namespace adit
