#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <vector>

#include "components/geometry/rigid.hpp"
#include "components/geometry/trajectory.hpp"
#include "components/runtime/component.hpp"
#include "components/runtime/stamp.hpp"
#include "nav_msgs/msg/odometry.hpp"

namespace adit {
namespace {

class TrajectoryWriterComponent final : public Component {
  using Odometry = nav_msgs::msg::Odometry;
  using Numbers = std::vector<double>;

  Param<std::string> path_{*this, "path", std::string("trajectory.tum"), "the TUM file to write"};
  Param<Numbers> sensor_pose_{*this, "sensor_pose", Numbers{0, 0, 0, 0, 0, 0, 1},
                              "of the odometry's child frame on the body: x y z [m], quaternion x y z w; the body's "
                              "poses are written"};
  Param<bool> covariance_{*this, "covariance", false,
                          "also write PATH with the ending .cov: stamp and covariance of x, y, yaw (upper triangle)"};
  Input<Odometry> odometry_{*this, "odometry", Qos::reliable(100), Queue{1000, WhenFull::drop_oldest},
                            [this](const Odometry& message, const MessageInfo&) { write(message); }};
  std::ofstream file_, covariance_file_;
  Pose body_from_sensor_ = Pose::Identity();
  std::optional<Time> last_;
  std::uint64_t left_out_ = 0;

  Result<void> configure() override {
    const std::filesystem::path path(path_.value());
    std::error_code ignored;
    if (path.has_parent_path()) std::filesystem::create_directories(path.parent_path(), ignored);
    file_.open(path, std::ios::trunc);
    if (!file_) return Error{ErrorCode::io, path.string() + ": cannot write: " + std::strerror(errno)};
    file_ << "# stamp tx ty tz qx qy qz qw\n" << std::flush;
    if (covariance_) {
      std::filesystem::path beside = path;
      beside.replace_extension(".cov");
      covariance_file_.open(beside, std::ios::trunc);
      if (!covariance_file_) return Error{ErrorCode::io, beside.string() + ": cannot write: " + std::strerror(errno)};
      covariance_file_ << "# stamp xx xy xa yy ya aa (m, rad)\n" << std::flush;
    }
    const Result<Pose> sensor = pose_from_numbers(sensor_pose_.value(), "sensor_pose");
    if (!sensor) return sensor.error();
    body_from_sensor_ = *sensor;
    return {};
  }

  Result<void> cleanup() override {
    file_.close();
    covariance_file_.close();
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
    // The odometry's frame is the sensor's at its start; that of what is written is the body's then.
    pose.pose = body_from_sensor_ * pose.pose * body_from_sensor_.inverse();
    file_ << tum_line(pose) << '\n' << std::flush;
    if (covariance_) write_covariance(pose.stamp_ns, message);
    if (!file_) health(Health::error, path_.value() + ": cannot write: " + std::strerror(errno));
  }

  void write_covariance(std::int64_t stamp_ns, const Odometry& message) {
    const auto at = [&](std::size_t row, std::size_t column) { return message.pose.covariance[6 * row + column]; };
    covariance_file_ << fmt::format("{}.{:09d} {:.9e} {:.9e} {:.9e} {:.9e} {:.9e} {:.9e}\n", stamp_ns / 1'000'000'000,
                                    stamp_ns % 1'000'000'000, at(0, 0), at(0, 1), at(0, 5), at(1, 1), at(1, 5),
                                    at(5, 5))
                     << std::flush;
  }
};

ADIT_COMPONENT(TrajectoryWriterComponent, "trajectory_writer");

}  // namespace
}  // namespace adit
