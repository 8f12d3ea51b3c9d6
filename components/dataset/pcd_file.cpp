#include "components/dataset/pcd_file.hpp"

#include <pcl/PCLPointCloud2.h>
#include <pcl/console/print.h>
#include <pcl/io/pcd_io.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

namespace adit::dataset {
namespace {

using Field = pcl::PCLPointField;

const Field* find(const pcl::PCLPointCloud2& cloud, std::initializer_list<const char*> names) {
  for (const char* name : names) {
    for (const Field& field : cloud.fields) {
      if (field.name == name) return &field;
    }
  }
  return nullptr;
}

template <class T>
double load(const std::uint8_t* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  return static_cast<double>(value);
}

double value_of(const Field& field, const std::uint8_t* row) {
  const std::uint8_t* const at = row + field.offset;
  switch (field.datatype) {
    case Field::INT8:
      return load<std::int8_t>(at);
    case Field::UINT8:
      return load<std::uint8_t>(at);
    case Field::INT16:
      return load<std::int16_t>(at);
    case Field::UINT16:
      return load<std::uint16_t>(at);
    case Field::INT32:
      return load<std::int32_t>(at);
    case Field::UINT32:
      return load<std::uint32_t>(at);
    case Field::FLOAT32:
      return load<float>(at);
    default:
      return load<double>(at);
  }
}

// PCL 1.13 crashes on headers without a FIELDS line and trusts the sizes of the others: look at the header first.
// Empty: fine; else what is wrong.
std::string header_fault(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::map<std::string, std::vector<std::string>> header;
  for (std::string line; header.size() < 12 && std::getline(file, line);) {
    std::istringstream words(line);
    std::string key, word;
    if (!(words >> key) || key.front() == '#') continue;
    while (words >> word) header[key].push_back(word);
    if (key == "DATA") break;
  }
  const std::size_t fields = header["FIELDS"].size();
  if (fields == 0 || header["DATA"].size() != 1) return "no PCD header (FIELDS and DATA are missing)";
  if (header["SIZE"].size() != fields || header["TYPE"].size() != fields ||
      (!header["COUNT"].empty() && header["COUNT"].size() != fields)) {
    return "FIELDS, SIZE, TYPE and COUNT have different lengths";
  }
  std::uintmax_t step = 0;
  for (std::size_t i = 0; i < fields; ++i) {
    const std::string count = header["COUNT"].empty() ? "1" : header["COUNT"][i];
    step += std::strtoul(header["SIZE"][i].c_str(), nullptr, 10) * std::strtoul(count.c_str(), nullptr, 10);
  }
  const std::uintmax_t points = header["POINTS"].empty() ? 0 : std::strtoull(header["POINTS"][0].c_str(), nullptr, 10);
  if (points == 0 || step == 0) return "POINTS or SIZE is 0";
  const std::uintmax_t rest = std::filesystem::file_size(path) - static_cast<std::uintmax_t>(file.tellg());
  const bool binary = header["DATA"][0] == "binary";
  // A point in text takes at least two characters a value; compressed data at least one byte a thousand points.
  const std::uintmax_t least = binary                         ? points * step
                               : header["DATA"][0] == "ascii" ? 2 * points * fields - 1
                                                              : points / 1000;
  if (rest < least) return "shorter than its " + std::to_string(points) + " points";
  return {};
}

}  // namespace

Result<PointFile> read_pcd(const std::string& path) {
  if (!std::filesystem::exists(path)) return Error{ErrorCode::not_found, path + ": no such file"};
  if (const std::string fault = header_fault(path); !fault.empty())
    return Error{ErrorCode::malformed, path + ": " + fault};
  pcl::PCLPointCloud2 cloud;
  const pcl::console::VERBOSITY_LEVEL level = pcl::console::getVerbosityLevel();
  pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);
  int read = -1;
  try {
    read = pcl::io::loadPCDFile(path, cloud);
  } catch (const std::exception&) {
    read = -1;
  }
  pcl::console::setVerbosityLevel(level);
  const Field* const columns[] = {find(cloud, {"x"}),
                                  find(cloud, {"y"}),
                                  find(cloud, {"z"}),
                                  find(cloud, {"intensity"}),
                                  find(cloud, {"time", "t", "timestamp", "offset_time"}),
                                  find(cloud, {"ring", "line", "channel"})};
  if (read < 0 || !columns[0] || !columns[1] || !columns[2]) {
    return Error{ErrorCode::malformed, path + ": not a PCD file with x, y and z"};
  }
  PointFile points;
  points.points = static_cast<std::size_t>(cloud.width) * cloud.height;
  const std::vector<std::string> names = standard_fields(6);
  std::vector<const Field*> used;
  std::vector<double> scale;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (!columns[i]) continue;
    const bool integer = columns[i]->datatype != Field::FLOAT32 && columns[i]->datatype != Field::FLOAT64;
    points.fields.push_back(names[i]);
    used.push_back(columns[i]);
    scale.push_back(names[i] == "time" && integer ? 1e-9 : 1.0);
  }
  points.values.reserve(points.points * used.size());
  for (std::size_t p = 0; p < points.points; ++p) {
    const std::uint8_t* const row = cloud.data.data() + p * cloud.point_step;
    for (std::size_t i = 0; i < used.size(); ++i) {
      points.values.push_back(static_cast<float>(scale[i] * value_of(*used[i], row)));
    }
  }
  return points;
}

}  // namespace adit::dataset
