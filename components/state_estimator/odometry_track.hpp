// One odometry over time: from its poses to motions between two instants, with its gaps, restarts and repeats told
// apart.
#pragma once

#include <optional>

#include "components/state_estimator/config.hpp"
#include "components/state_estimator/samples.hpp"

namespace adit::state_estimator {

class OdometryTrack {
 public:
  OdometryTrack(const OdometrySensor& config, std::uint8_t sensor) : config_(config), sensor_(sensor) {}

  // The measurement that a sample makes with the one it is relative to. `fused` when there is one; it counts when
  // accept() is told of it. Everything else: the sample is not used, or (first, gap, jump) the next one starts from it.
  // `level`: body axes to levelled ones by the IMU, for odometries whose own frame is not level.
  Verdict follow(const OdometrySample& sample, const std::optional<Eigen::Matrix3d>& level, Measurement& out);
  // What became of the last measurement of follow(): the next one starts from its sample, or, when it is `trusted`,
  // from the anchor still.
  void accept(const OdometrySample& sample, Verdict verdict, bool trusted);
  void restart() { anchor_ = previous_ = std::nullopt; }

  const OdometrySensor& config() const { return config_; }
  // The sample before the one that follow() was given last.
  const Pose& previous_pose() const { return previous_->pose; }

 private:
  RelativeMotion motion(const OdometrySample& from, const OdometrySample& to,
                        const std::optional<Eigen::Matrix3d>& level) const;
  Verdict begin_anew(const OdometrySample& sample, Verdict why);

  OdometrySensor config_;
  std::uint8_t sensor_;
  std::optional<OdometrySample> anchor_;    // what the next motion starts from
  std::optional<OdometrySample> previous_;  // the sample before
};

// A rotation without its heading: body axes to levelled axes.
Eigen::Matrix3d level_of(const Eigen::Matrix3d& rotation);

}  // namespace adit::state_estimator
