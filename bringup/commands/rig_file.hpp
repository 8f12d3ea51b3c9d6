// The simulator's extrinsics.yaml: where the sensors sit.
#pragma once

#include <map>
#include <string>

#include "components/geometry/se3.hpp"
#include "components/runtime/value.hpp"
#include "idl/result.hpp"

namespace adit {

struct RigFile {
  std::map<std::string, Pose> poses;      // of the matrices, by name: T_base_lidar, ...
  std::map<std::string, double> numbers;  // thermal_row_time, ...
};

// "name:" and four rows "- [a, b, c, d]", or "name: number"; other lines are skipped. Errors name file and line.
Result<RigFile> read_rig_file(const std::string& path);

// As the components' parameters have poses: x y z [m], quaternion x y z w.
Value::List pose_parameter(const Pose& pose);

}  // namespace adit
