#include "components/tunnel_simulator/scenario.hpp"

namespace adit::tunnel_simulator {

Eigen::Matrix3d optical_axes() {
  Eigen::Matrix3d r;
  r << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return r;
}

Rig default_rig(VehicleKind kind) {
  Rig rig;
  const bool car = kind == VehicleKind::car;
  rig.lidar.translation() = car ? Eigen::Vector3d(0.9, 0.0, 2.0) : Eigen::Vector3d(0.10, 0.0, 0.85);
  rig.thermal.translation() = car ? Eigen::Vector3d(1.5, 0.0, 1.75) : Eigen::Vector3d(0.40, 0.0, 0.65);
  rig.thermal.linear() = optical_axes();
  rig.imu.translation() = car ? Eigen::Vector3d(0.9, 0.0, 1.9) : Eigen::Vector3d(0.0, 0.0, 0.5);
  rig.antenna = car ? Eigen::Vector3d(0.2, 0.0, 2.1) : Eigen::Vector3d(-0.2, 0.0, 0.9);
  return rig;
}

}  // namespace adit::tunnel_simulator
