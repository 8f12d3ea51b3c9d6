#include "components/tunnel_simulator/bag_sink.hpp"

#include <cmath>

#include "adit_msgs/msg/thermal_frame.hpp"
#include "components/dataset/bag_qos.hpp"
#include "components/tunnel_simulator/sensor_messages.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "sensor_msgs/msg/camera_info.hpp"
#include "sensor_msgs/msg/image.hpp"
#include "sensor_msgs/msg/imu.hpp"
#include "sensor_msgs/msg/nav_sat_fix.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"
#include "tf2_msgs/msg/tf_message.hpp"

namespace adit::tunnel_simulator {

struct BagSink::Messages {
  sensor_msgs::msg::PointCloud2 points;
  adit_msgs::msg::ThermalFrame frame;
  sensor_msgs::msg::Image image;
  sensor_msgs::msg::CameraInfo camera_info;
  sensor_msgs::msg::Imu imu;
  sensor_msgs::msg::NavSatFix fix;
  nav_msgs::msg::Odometry truth;
};

BagSink::BagSink(std::unique_ptr<dataset::BagWriter> writer, const Simulation& simulation, bool plain_images)
    : writer_(std::move(writer)),
      simulation_(simulation),
      plain_images_(plain_images),
      messages_(std::make_unique<Messages>()) {}
BagSink::~BagSink() = default;

Result<std::unique_ptr<BagSink>> BagSink::create(const std::string& folder, const Simulation& simulation,
                                                 bool plain_images) {
  auto writer = dataset::BagWriter::create(folder);
  if (!writer) return writer.error();
  std::unique_ptr<BagSink> sink(new BagSink(*std::move(writer), simulation, plain_images));
  tf2_msgs::msg::TFMessage rig;
  fill_rig(simulation.scenario(), rig);
  sink->write("/tf_static", rig, std::llround(simulation.scenario().epoch * 1e9), true);
  if (sink->error_) return *sink->error_;
  return sink;
}

template <class Message>
void BagSink::write(const std::string& topic, const Message& message, std::int64_t stamp_ns, bool latched) {
  const TypeInfo& type = type_info<Message>();
  const auto index = writer_->add_topic({topic, std::string(type.ros_name),
                                         dataset::bag_qos_text({{true, latched, latched ? 1U : 10U}}),
                                         std::string(type.type_hash), std::string(type.schema)});
  if (!index) {
    error_ = index.error();
    return;
  }
  bytes_.resize(encoded_size(message));
  if (encode(message, bytes_) != bytes_.size()) {
    error_ = Error{ErrorCode::internal, topic + ": a message that cannot be encoded"};
    return;
  }
  if (auto written = writer_->write({*index, stamp_ns, bytes_}); !written) error_ = written.error();
}

void BagSink::on_lidar(const LidarScan& scan, const Delivery& delivery) {
  if (auto filled = fill(scan, delivery, messages_->points); !filled) {
    error_ = filled.error();
    return;
  }
  write("/lidar/points", messages_->points, delivery.arrival_ns);
}

void BagSink::on_thermal(const ThermalImage& image, const Delivery& delivery) {
  const Scenario& scenario = simulation_.scenario();
  fill(image, delivery, scenario, messages_->frame);
  write("/thermal/frame", messages_->frame, delivery.arrival_ns);
  fill_camera_info(delivery, scenario, messages_->camera_info);
  write("/thermal/camera_info", messages_->camera_info, delivery.arrival_ns);
  if (!plain_images_) return;
  fill(image, delivery, scenario, messages_->image);
  write("/thermal/image_raw", messages_->image, delivery.arrival_ns);
}

void BagSink::on_imu(const ImuSample& sample, const Delivery& delivery) {
  fill(sample, simulation_.scenario().imu, messages_->imu);
  write("/imu", messages_->imu, delivery.arrival_ns);
}

void BagSink::on_gnss(const GnssSample& sample, const Delivery& delivery) {
  fill(sample, messages_->fix);
  write("/gnss/fix", messages_->fix, delivery.arrival_ns);
}

void BagSink::on_truth(double time, const Pose& /*world_base*/) {
  fill_truth(simulation_, time - simulation_.scenario().epoch, messages_->truth);
  write("/ground_truth/odometry", messages_->truth, std::llround(time * 1e9));
}

bool BagSink::stop() {
  return error_.has_value();
}

Result<void> BagSink::finish() {
  if (error_) return *error_;
  return writer_->close();
}

}  // namespace adit::tunnel_simulator
