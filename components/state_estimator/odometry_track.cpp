#include "components/state_estimator/odometry_track.hpp"

namespace adit::state_estimator {

Eigen::Matrix3d level_of(const Eigen::Matrix3d& rotation) {
  return so3_exp({0.0, 0.0, -yaw(rotation)}) * rotation;
}

Verdict OdometryTrack::begin_anew(const OdometrySample& sample, Verdict why) {
  anchor_ = previous_ = sample;
  return why;
}

RelativeMotion OdometryTrack::motion(const OdometrySample& from, const OdometrySample& to,
                                     const std::optional<Eigen::Matrix3d>& level) const {
  RelativeMotion motion;
  motion.from_ns = from.stamp_ns;
  motion.to_ns = to.stamp_ns;
  motion.motion = from.pose.inverse() * to.pose;
  motion.information = to.information;
  motion.suspicion = to.suspicion;
  motion.log_scale_sigma = to.log_scale_sigma;
  if (config_.level) {
    motion.level = level_of(from.pose.linear() * config_.odometry.body_from_sensor.linear().transpose());
  } else if (level) {
    motion.level = *level;
  }
  return motion;
}

Verdict OdometryTrack::follow(const OdometrySample& sample, const std::optional<Eigen::Matrix3d>& level,
                              Measurement& out) {
  if (!previous_ || previous_->frame != sample.frame) return begin_anew(sample, Verdict::first);
  const double step = seconds_between(previous_->stamp_ns, sample.stamp_ns);
  if (step == 0.0) return Verdict::duplicate;
  if (step < 0.0 && step > -1.0) return Verdict::too_old;
  if (step < 0.0 || step > config_.odometry.max_interval_s) return begin_anew(sample, Verdict::gap);
  switch (to_measurement(motion(*anchor_, sample, level), config_.odometry, sensor_, out)) {
    case Conversion::ok:
      break;
    case Conversion::not_finite:
      return Verdict::malformed;
    case Conversion::bad_interval:
      return begin_anew(sample, Verdict::gap);
    case Conversion::implausible:
      return begin_anew(sample, Verdict::jump);
  }
  if (anchor_->stamp_ns != previous_->stamp_ns) {
    Measurement last;  // the anchor may be seconds back: the motion of now is that of the last step
    if (to_measurement(motion(*previous_, sample, level), config_.odometry, sensor_, last) == Conversion::implausible) {
      return begin_anew(sample, Verdict::jump);
    }
    out.motion = last.motion;
  }
  return Verdict::fused;
}

void OdometryTrack::accept(const OdometrySample& sample, Verdict verdict, bool trusted) {
  previous_ = sample;
  const bool keep = config_.odometry.anchor_period_s > 0.0 && verdict == Verdict::fused && trusted &&
                    seconds_between(anchor_->stamp_ns, sample.stamp_ns) < config_.odometry.anchor_period_s;
  if (!keep) anchor_ = sample;
}

}  // namespace adit::state_estimator
