#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "components/geometry/trajectory.hpp"
#include "components/runtime/component.hpp"
#include "components/runtime/stamp.hpp"
#include "nav_msgs/msg/odometry.hpp"

namespace adit {
namespace {

class TrajectoryWriterComponent final : public Component {
  using Odometry = nav_msgs::msg::Odometry;

  Param<std::string> path_{*this, "path", std::string("trajectory.tum"), "the TUM file to write"};
  Input<Odometry> odometry_{*this, "odometry", Qos::reliable(100), Queue{1000, WhenFull::drop_oldest},
                            [this](const Odometry& message, const MessageInfo&) { write(message); }};
  std::ofstream file_;
  std::optional<Time> last_;
  std::uint64_t left_out_ = 0;

  Result<void> configure() override {
    const std::filesystem::path path(path_.value());
    std::error_code ignored;
    if (path.has_parent_path()) std::filesystem::create_directories(path.parent_path(), ignored);
    file_.open(path, std::ios::trunc);
    if (!file_) return Error{ErrorCode::io, path.string() + ": cannot write: " + std::strerror(errno)};
    file_ << "# stamp tx ty tz qx qy qz qw\n" << std::flush;
    return {};
  }

  Result<void> cleanup() override {
    file_.close();
    last_.reset();
    return {};
  }

  void on_time_jump(Duration) override { last_.reset(); }

  void write(const Odometry& message) {
    const Time stamp = to_time(message.header.stamp);
    const auto& p = message.pose.pose.position;
    const auto& q = message.pose.pose.orientation;
    const Eigen::Quaterniond rotation(q.w, q.x, q.y, q.z);
    const Eigen::Vector3d position(p.x, p.y, p.z);
    const bool fine = position.allFinite() && std::abs(rotation.norm() - 1.0) < 0.01 && (!last_ || stamp > *last_);
    if (!fine) {
      health(Health::warn, std::to_string(++left_out_) + " poses left out: not finite, or the stamp did not increase");
      return;
    }
    last_ = stamp;
    StampedPose pose;
    pose.stamp_ns = stamp.time_since_epoch().count();
    pose.pose.linear() = rotation.normalized().toRotationMatrix();
    pose.pose.translation() = position;
    file_ << tum_line(pose) << '\n' << std::flush;
    if (!file_) health(Health::error, path_.value() + ": cannot write: " + std::strerror(errno));
  }
};

ADIT_COMPONENT(TrajectoryWriterComponent, "trajectory_writer");

}  // namespace
}  // namespace adit
