// Where the camera was and how it moved: what the alignment of the next frame starts from, what it falls back to when
// that fails, and what its own rates of a rolling readout follow from.
#pragma once

#include <cstdint>

#include "components/thermal_odometry/frame.hpp"
#include "components/thermal_odometry/tracker.hpp"

namespace adit::thermal_odometry {

class FrameAligner {
 public:
  struct Config {
    double gap_s = 0.1;                 // longer since the last frame: start coarser, from several poses
    bool prior_as_information = false;  // besides starting there: add the prior to the normal equations (paper R63)
    // What may have changed the velocity while nothing was seen [m/s2]: walls that look alike offer other places, and
    // one that only a stronger push explains is refused. In the unit of a monocular map, usually several metres, a weak
    // check. An emergency stop from 50 km/h is 8.
    double max_acceleration = 10.0;
  };
  explicit FrameAligner(const Config& config) : config_(config) {}

  struct Alignment {
    TrackResult result;
    double dt = 0.0;  // s since the last pose
    bool gap = false;
    Pose predicted = Pose::Identity();  // T_cw by constant velocity
  };
  // From the cheapest of the constant-velocity pose, the prior's and, after a gap, the last one; if that fails by small
  // turns about it. After a gap a place that constant velocity (or the prior) cannot have led to is not believed: then
  // from there alone and without the coarsest levels, or not at all. Changes nothing here.
  Alignment align(const Tracker& tracker, const Pyramid& image, std::int64_t stamp_ns, double reference_gain,
                  const Prior* prior) const;

  // The camera was there at that time: a measured pose, whose motion since the last one is the next prediction.
  void move_to(std::int64_t stamp_ns, const CameraState& state);
  // The same place and time said again, better (the window adjusted the newest keyframe): velocity stays.
  void correct(const CameraState& state);
  // A map begins: there and then, the motion stays what it is known to be.
  void begin_at(std::int64_t stamp_ns, const CameraState& state) {
    correct(state);
    stamp_ns_ = stamp_ns;
  }
  // A new place without known motion.
  void place(std::int64_t stamp_ns, const Pose& T_cw);
  void set_velocity(const Vector6d& velocity);  // left twist of T_cw [1/s]
  void forget_velocity() { has_velocity_ = false; }
  // All lengths are `factor` times what they were.
  void rescale(double factor) { velocity_.head<3>() *= factor; }

  const Pose& T_cw() const { return state_.T_cw; }
  std::int64_t stamp_ns() const { return stamp_ns_; }  // 0: none yet

 private:
  TrackResult search(const Tracker& tracker, const Pyramid& image, const CameraState& start,
                     const Tracker::PosePrior* prior, const Tracker::Before& before) const;
  bool within_reach(const TrackResult& result, const Pose& expected, double dt) const;

  Config config_;
  CameraState state_;
  std::int64_t stamp_ns_ = 0;
  bool has_velocity_ = false;
  Vector6d velocity_ = Vector6d::Zero();         // mean of the last interval
  Vector6d velocity_change_ = Vector6d::Zero();  // from the middle of an interval to its end
  double spin_variance_ = 0.0;                   // of the spin foreseen so for a frame [rad2/s2]
};

}  // namespace adit::thermal_odometry
