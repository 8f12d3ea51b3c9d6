// Where the odometry frame lies on the Earth: satellite fixes in metres, and the turn between east and odom's x axis
// found on the first metres driven in the open.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

namespace adit::state_estimator {

struct Geodetic {
  double latitude = 0.0, longitude = 0.0, altitude = 0.0;  // degrees, degrees, m above the WGS 84 ellipsoid
};

// East, north, up of `point` in the tangent plane at `origin` [m].
Eigen::Vector3d to_local(const Geodetic& origin, const Geodetic& point);

class GnssFrame {
 public:
  struct Config {
    double baseline_m = 40.0;  // driven before the frames are aligned
    double max_sigma_m = 0.5;  // worse fixes do not take part in it
    std::size_t max_pairs = 2000;
  };
  // What a fix says in the odometry frame; the covariance contains that of the alignment.
  struct Fix {
    Eigen::Vector2d position = Eigen::Vector2d::Zero();
    Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();
  };

  explicit GnssFrame(const Config& config) : config_(config) {}

  // The frames are known: odom's origin and the heading of its x axis (counter-clockwise from east) in the local frame.
  void set(const Eigen::Vector2d& origin, double heading);
  bool aligned() const { return aligned_; }
  double heading() const { return heading_; }

  // Before it is aligned: a fix [m, local east and north], its deviation, and where odometry saw the antenna then. True
  // when this pair completes the alignment: least squares after Umeyama 1991 without scale.
  bool add(const Eigen::Vector2d& local, double sigma, const Eigen::Vector2d& antenna_in_odom);
  // Precondition: aligned().
  Fix to_odom(const Eigen::Vector2d& local, const Eigen::Matrix2d& covariance) const;

 private:
  struct Pair {
    Eigen::Vector2d local, odom;
  };
  Config config_;
  std::vector<Pair> pairs_;
  double sigma_sum_ = 0.0;
  bool aligned_ = false;
  double heading_ = 0.0, heading_variance_ = 0.0;
  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();  // of odom in the local frame
  Eigen::Vector2d centre_ = Eigen::Vector2d::Zero();  // of the pairs, in odom: what the turn is about
};

}  // namespace adit::state_estimator
