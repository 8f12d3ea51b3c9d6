#include "components/dataset/dataset.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>

namespace adit::dataset {
namespace {

namespace fs = std::filesystem;

// Nanoseconds per unit of a stamp column, from the comment line that names the columns.
double unit_of(const std::string& comment) {
  if (comment.find("_us") != std::string::npos) return 1e3;
  if (comment.find("_ms") != std::string::npos) return 1e6;
  if (comment.find("_s") != std::string::npos && comment.find("_ns") == std::string::npos) return 1e9;
  return 1.0;
}

std::optional<std::int64_t> stamp_of(const std::string& text, double unit) {
  if (text.find('.') != std::string::npos) unit = 1e9;
  std::int64_t whole = 0;
  const char* const end = text.data() + text.size();
  const auto [point, bad] = std::from_chars(text.data(), end, whole);
  if (bad == std::errc{} && point == end && unit != 1e9) return whole * static_cast<std::int64_t>(unit);
  double value = 0.0;
  const auto [rest, bad_value] = std::from_chars(text.data(), end, value);
  if (bad_value != std::errc{} || rest != end || !std::isfinite(value) || std::abs(value * unit) > 9e18) return {};
  return std::llround(value * unit);
}

// Column 1: a file in `folder`, or a number that names one ("12" -> 000012.png). Column 2: the stamp, where it is one.
Result<Dataset> read_index(const fs::path& index, const fs::path& folder, Dataset::Kind kind, double rate_hz) {
  std::ifstream file(index);
  if (!file) return Error{ErrorCode::not_found, index.string() + ": cannot read"};
  const char* const ending = kind == Dataset::Kind::png16 ? ".png" : ".bin";
  Dataset dataset;
  dataset.kind = kind;
  double unit = kind == Dataset::Kind::png16 ? 1e9 : 1.0;
  bool stamped = true;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    const auto bad = [&](const std::string& why) {
      return Error{ErrorCode::malformed, index.string() + ":" + std::to_string(number) + ": " + why};
    };
    if (line.starts_with('#')) {
      unit = unit_of(line);
      stamped = line.find("time") != std::string::npos || line.find("stamp") != std::string::npos;
      continue;
    }
    std::istringstream fields(line);
    std::string name, stamp, points;
    if (!(fields >> name)) continue;
    Entry entry;
    if (fs::path(name).extension().empty())
      name = std::string(6 - std::min<std::size_t>(6, name.size()), '0') + name + ending;
    entry.path = (folder / name).string();
    if (!fs::exists(entry.path)) return bad("'" + entry.path + "' does not exist");
    if (stamped) {
      if (!(fields >> stamp)) return bad("the stamp is missing");
      const std::optional<std::int64_t> value = stamp_of(stamp, unit);
      if (!value) return bad("'" + stamp + "' is not a stamp");
      entry.stamp_ns = *value;
    } else {
      entry.stamp_ns = std::llround(1e9 * static_cast<double>(dataset.entries.size()) / rate_hz);
    }
    if (fields >> points) {
      const auto [end, wrong] = std::from_chars(points.data(), points.data() + points.size(), entry.points);
      if (wrong != std::errc{} || end != points.data() + points.size())
        return bad("'" + points + "' is not a number of points");
    }
    if (!dataset.entries.empty() && entry.stamp_ns < dataset.entries.back().stamp_ns)
      return bad("the stamp runs backwards");
    dataset.entries.push_back(std::move(entry));
  }
  if (dataset.entries.empty()) return Error{ErrorCode::malformed, index.string() + ": the index is empty"};
  return dataset;
}

// Every file with this ending, by name, stamped at the rate.
Dataset list_files(const fs::path& folder, const char* ending, Dataset::Kind kind, double rate_hz) {
  Dataset dataset;
  dataset.kind = kind;
  std::error_code ignored;
  for (const auto& file : fs::directory_iterator(folder, ignored)) {
    if (file.path().extension() == ending) dataset.entries.push_back({file.path().string(), 0, 0});
  }
  std::sort(dataset.entries.begin(), dataset.entries.end(),
            [](const Entry& a, const Entry& b) { return a.path < b.path; });
  for (std::size_t i = 0; i < dataset.entries.size(); ++i) {
    dataset.entries[i].stamp_ns = std::llround(1e9 * static_cast<double>(i) / rate_hz);
  }
  return dataset;
}

}  // namespace

Result<Dataset> open_images(const std::string& folder, double rate_hz) {
  const fs::path root(folder);
  const fs::path images = fs::is_directory(root / "images") ? root / "images" : root;
  if (fs::exists(root / "times.txt")) {
    return read_index(root / "times.txt", images, Dataset::Kind::png16, rate_hz);
  }
  Dataset dataset = list_files(images, ".png", Dataset::Kind::png16, rate_hz);
  if (dataset.entries.empty()) return Error{ErrorCode::not_found, folder + ": no images: expected images/*.png"};
  return dataset;
}

Result<Dataset> open_dataset(const std::string& folder, double rate_hz) {
  const fs::path root(folder);
  if (!fs::is_directory(root)) return Error{ErrorCode::not_found, folder + ": no such folder"};
  for (const fs::path& scans : {root / "scans", root}) {
    if (fs::exists(scans / "index.txt")) return read_index(scans / "index.txt", scans, Dataset::Kind::bin, rate_hz);
  }
  if (fs::exists(root / "times.txt")) return open_images(folder, rate_hz);
  struct Plain {
    const char* ending;
    Dataset::Kind kind;
  };
  for (const fs::path& place : {root, root / "scans", root / "images", root / "pcd"}) {
    for (const Plain& plain :
         {Plain{".pcd", Dataset::Kind::pcd}, Plain{".bin", Dataset::Kind::bin}, Plain{".png", Dataset::Kind::png16}}) {
      Dataset dataset = list_files(place, plain.ending, plain.kind, rate_hz);
      if (!dataset.entries.empty()) return dataset;
    }
  }
  return Error{ErrorCode::not_found,
               folder + ": no data: expected scans/index.txt with .bin files, *.pcd, or images/*.png with times.txt"};
}

}  // namespace adit::dataset
