#include "components/geometry/rigid.hpp"

namespace adit {

bool is_rigid(const Pose& pose) {
  const Eigen::Matrix3d r = pose.linear();
  return pose.matrix().allFinite() && pose.translation().norm() < 1e7 && r.determinant() > 0.0 &&
         (r * r.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-3;
}

}  // namespace adit
