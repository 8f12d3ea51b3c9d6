#include "middleware/cyclonedds/security.hpp"

#include <dlfcn.h>
#include <unistd.h>

#include <filesystem>

namespace adit::cyclonedds {
namespace {

// Debian installs the plug-ins off the loader's path, in a folder beside libddsc named after its version.
std::string plugin(const std::string& file) {
  Dl_info info{};
  if (dladdr(reinterpret_cast<const void*>(&dds_create_participant), &info) && info.dli_fname) {
    std::error_code ignored;
    const auto folder = std::filesystem::canonical(info.dli_fname, ignored).parent_path();
    for (const char* place : {"libddsc0debian", "."}) {
      const auto path = folder / place / file;
      if (std::filesystem::exists(path, ignored)) return path.string();
    }
  }
  return file;
}

}  // namespace

Result<void> secure(const SecurityConfig& config, dds_qos_t* qos) {
  std::filesystem::path enclave = std::filesystem::path(config.keystore) / "enclaves";
  enclave += config.enclave == "/" ? "" : config.enclave;
  struct Property {
    const char* name;
    const char* file;
  };
  const Property files[] = {
      {"dds.sec.auth.identity_ca", "identity_ca.cert.pem"},
      {"dds.sec.auth.identity_certificate", "cert.pem"},
      {"dds.sec.auth.private_key", "key.pem"},
      {"dds.sec.access.permissions_ca", "permissions_ca.cert.pem"},
      {"dds.sec.access.governance", "governance.p7s"},
      {"dds.sec.access.permissions", "permissions.p7s"},
  };
  for (const Property& property : files) {
    const std::string path = (enclave / property.file).string();
    if (access(path.c_str(), R_OK) != 0) {
      return Error{ErrorCode::not_found, "security: cannot read " + path +
                                             "; create the enclave with 'ros2 security create_enclave', or correct "
                                             "keystore and enclave"};
    }
    dds_qset_prop(qos, property.name, ("file:" + path).c_str());
  }
  struct Plugin {
    const char* topic;
    const char* file;
    const char* name;
  };
  const Plugin plugins[] = {{"auth", "libdds_security_auth.so", "authentication"},
                            {"crypto", "libdds_security_crypto.so", "crypto"},
                            {"access", "libdds_security_ac.so", "access_control"}};
  for (const Plugin& entry : plugins) {
    const std::string prefix = std::string("dds.sec.") + entry.topic + ".library.";
    dds_qset_prop(qos, (prefix + "path").c_str(), plugin(entry.file).c_str());
    dds_qset_prop(qos, (prefix + "init").c_str(), (std::string("init_") + entry.name).c_str());
    dds_qset_prop(qos, (prefix + "finalize").c_str(), (std::string("finalize_") + entry.name).c_str());
  }
  return {};
}

}  // namespace adit::cyclonedds
