#include "bringup/offline/source.hpp"

#include <filesystem>

namespace adit::offline {

Result<std::unique_ptr<Source>> open_source(const std::string& path, const SourceOptions& options) {
  const std::filesystem::path file(path);
  if (!std::filesystem::exists(file)) return Error{ErrorCode::not_found, path + ": there is nothing of this name"};
  if (file.extension() == ".db3" || std::filesystem::exists(file / "metadata.yaml")) return open_bag(path, options);
  if (std::filesystem::is_directory(file)) return open_folder(path, options);
  if (file.extension() == ".yaml") return open_scenario(path, options);
  return Error{ErrorCode::invalid_argument, path + ": neither a scenario (.yaml), nor a bag, nor a folder of clouds"};
}

}  // namespace adit::offline
