// Files of a recorded folder as messages.
#pragma once

#include <string>

#include "adit_msgs/msg/thermal_frame.hpp"
#include "components/dataset/png16.hpp"
#include "components/dataset/point_file.hpp"
#include "components/geometry/trajectory.hpp"
#include "middleware/time.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/image.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"

namespace adit::dataset_player {

// Every column a FLOAT32 field; the data is the file's, copied once. Reuses the message's memory.
void fill(const dataset::PointFile& cloud, Time stamp, const std::string& frame_id, sensor_msgs::msg::PointCloud2& out);

// Raw counts: not radiometric, FFC state unknown to files.
void fill(const dataset::Image16& image, Time stamp, const std::string& frame_id, std::uint32_t counter,
          adit_msgs::msg::ThermalFrame& out);
void fill(const dataset::Image16& image, Time stamp, const std::string& frame_id, sensor_msgs::msg::Image& out);

// Pose of `child_frame` in `frame`; covariance zero: the file does not say.
void fill(const StampedPose& pose, const std::string& frame, const std::string& child_frame,
          nav_msgs::msg::Odometry& out);

}  // namespace adit::dataset_player
