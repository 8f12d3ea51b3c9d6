// The estimator a program uses: odometries, IMU and GNSS in, pose and status out at any rate.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "components/state_estimator/config.hpp"
#include "components/state_estimator/estimate.hpp"
#include "components/state_estimator/odometry_track.hpp"
#include "components/state_estimator/replay_buffer.hpp"
#include "components/state_estimator/samples.hpp"
#include "components/state_estimator/status.hpp"

namespace adit::state_estimator {

// Motion between two instants with the covariance of exactly this motion: the prior for a front end. It contains what
// the same front end delivered before `to`; a front end that optimizes with it must hand back the likelihood alone.
struct RelativePrediction {
  PlanarPose motion = PlanarPose::Zero();  // base_link at `to` in base_link at `from`
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double thermal_scale = 1.0;  // thermal length / true length
};

// Not thread safe: one strand. No heap after construction, but for status(). `now_ns` is the caller's clock at the
// call, used to tell late from future and to notice that the clock was set; offline: the stamp of the message.
class StateEstimator {
 public:
  static Result<std::unique_ptr<StateEstimator>> create(const Config& config);

  // Starts at an instant, at the configured initial pose; without a call the first measurement does it.
  void start(std::int64_t now_ns);
  bool started() const { return started_; }

  // Index by name; -1 when there is none. Names: those of the configuration, "imu", "gnss", "zero_velocity".
  int sensor(const std::string& name) const;

  Verdict add_odometry(int sensor, const OdometrySample& sample, std::int64_t now_ns);
  Verdict add_motion(int sensor, const RelativeMotion& motion, std::int64_t now_ns);
  Verdict add_imu(const ImuSample& sample, std::int64_t now_ns);
  Verdict add_gnss(const GnssSample& sample, std::int64_t now_ns);
  // Any sensor of one's own: add_sensor() before the first measurement, then measurements of its model.
  int add_sensor(const std::string& name, SensorModel model);
  Verdict add_measurement(const Measurement& measurement, std::int64_t now_ns);

  // An absolute pose in map (loop closure, map matching): corrects map -> odom, never odom.
  MapCorrection::Outcome add_closure(std::int64_t stamp_ns, const PlanarPose& map_body,
                                     const Eigen::Matrix3d& covariance);
  const MapCorrection& map_correction() const { return map_; }

  // The pose at an instant within the history or later; before: nothing. Finite for every finite input.
  std::optional<Estimate> estimate(std::int64_t stamp_ns) const;
  // For publishing: as estimate(), but never an instant before the one published last, and continuous: what a
  // correction moves beyond the configured jump fades in.
  std::optional<Estimate> publish(std::int64_t now_ns);
  std::optional<RelativePrediction> predict_motion(std::int64_t from_ns, std::int64_t to_ns) const;
  Status status(std::int64_t now_ns) const;
  const FilterState& state() const { return replay_.head(); }

 private:
  struct Counters {
    std::uint64_t too_old = 0, duplicates = 0, future = 0, malformed = 0, gaps = 0, jumps = 0;
  };

  explicit StateEstimator(const Config& config);
  Verdict count(int sensor, Verdict verdict);
  bool watch_clock(std::int64_t now_ns);
  void restart_at(std::int64_t stamp_ns, std::int64_t pose_of_ns);
  Verdict insert(const Measurement& measurement, std::int64_t now_ns);
  void maybe_stand_still(std::int64_t stamp_ns, std::int64_t now_ns);
  void carry_attitude(const OdometryTrack& track, const Pose& from, const OdometrySample& to);
  Estimate estimate_of(const FilterState& state) const;

  Config config_;
  Filter filter_;
  ReplayBuffer replay_;
  MapCorrection map_;
  Tilt tilt_;
  StandstillDetector standstill_;
  std::vector<OdometryTrack> odometries_;  // by sensor index
  std::vector<std::string> names_;
  std::array<Counters, kMaxSensors> counters_;
  int imu_ = -1, gnss_ = -1, zero_velocity_ = -1;
  bool started_ = false;
  bool measured_ = false;  // something was fused: until then odom is where the body is
  std::int64_t now_ns_ = kNoStamp, published_ns_ = kNoStamp, zero_velocity_ns_ = kNoStamp;
  std::int64_t closure_ns_ = kNoStamp;
  std::uint64_t clock_jumps_ = 0, forgotten_motions_ = 0, replays_ = 0;
  OutputSmoother smoother_;
  double height_ = 0.0;
  int height_from_ = -1;
  std::int64_t height_ns_ = kNoStamp;
  Eigen::Matrix3d tilt_from_odometry_ = Eigen::Matrix3d::Identity();
  OdomTilt odom_tilt_;
};

}  // namespace adit::state_estimator
