#include "bringup/commands/rig_file.hpp"

#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "components/geometry/rigid.hpp"

namespace adit {

Result<RigFile> read_rig_file(const std::string& path) {
  RigFile rig;
  std::ifstream file(path);
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    const std::size_t colon = line.find(':');
    if (line.empty() || line[0] == '#' || colon == std::string::npos) continue;
    const std::string name = line.substr(0, colon);
    if (!name.starts_with("T_")) {
      char* end = nullptr;
      const char* text = line.c_str() + colon + 1;
      const double value = std::strtod(text, &end);
      if (end != text) rig.numbers[name] = value;
      continue;
    }
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Zero();
    for (int row = 0; row < 4; ++row, ++number) {
      const bool read =
          std::getline(file, line) && std::sscanf(line.c_str(), " - [%lf, %lf, %lf, %lf]", &matrix(row, 0),
                                                  &matrix(row, 1), &matrix(row, 2), &matrix(row, 3)) == 4;
      if (!read) {
        return Error{ErrorCode::malformed,
                     path + ":" + std::to_string(number + 1) + ": 4 rows '- [a, b, c, d]' are wanted"};
      }
    }
    Pose pose = Pose::Identity();
    pose.linear() = matrix.topLeftCorner<3, 3>();
    pose.translation() = matrix.topRightCorner<3, 1>();
    rig.poses[name] = pose;
  }
  return rig;
}

Value::List pose_parameter(const Pose& pose) {
  const std::array<double, 7> v = numbers_of(pose);
  return Value::List(v.begin(), v.end());
}

}  // namespace adit
