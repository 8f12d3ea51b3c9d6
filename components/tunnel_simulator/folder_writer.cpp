#include "components/tunnel_simulator/folder_writer.hpp"

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iomanip>

#include "components/geometry/trajectory.hpp"

namespace adit::tunnel_simulator {
namespace {

std::string numbered(std::uint64_t number, const char* extension) {
  char text[32];
  std::snprintf(text, sizeof text, "%06llu%s", static_cast<unsigned long long>(number), extension);
  return text;
}

std::int64_t nanoseconds(double seconds) {
  return std::llround(seconds * 1e9);
}

void write_matrix(std::ostream& out, const char* name, const Pose& pose) {
  out << name << ":\n" << std::setprecision(12);
  for (int r = 0; r < 4; ++r) {
    out << "  - [";
    for (int c = 0; c < 4; ++c) out << pose.matrix()(r, c) << (c < 3 ? ", " : "]\n");
  }
}

}  // namespace

Result<std::unique_ptr<FolderWriter>> FolderWriter::open(const std::string& folder, const Simulation& simulation) {
  std::error_code failed;
  const Scenario& s = simulation.scenario();
  std::filesystem::create_directories(folder, failed);
  if (s.lidar_on) std::filesystem::create_directories(folder + "/scans", failed);
  if (s.thermal_on) std::filesystem::create_directories(folder + "/images", failed);
  if (failed) return Error{ErrorCode::io, folder + ": " + failed.message()};
  std::unique_ptr<FolderWriter> writer(new FolderWriter(folder, simulation));
  std::optional<Error> error;
  const auto create = [&](std::ofstream& stream, const std::string& name, const char* header) {
    stream.open(folder + "/" + name, std::ios::trunc);
    if (!stream) error = Error{ErrorCode::io, folder + "/" + name + ": cannot be written"};
    stream << header;
  };
  if (s.lidar_on) {
    create(writer->scan_index_, "scans/index.txt",
           "# file stamp_ns(of the sweep's start) n_points ; bin = float32 x,y,z,intensity,t_rel[s],ring\n");
    create(writer->lidar_start_, "gt_start.tum", "");
    create(writer->lidar_middle_, "gt_mid.tum", "");
    create(writer->lidar_end_, "gt_end.tum", "");
  }
  if (s.thermal_on) {
    create(writer->times_, "times.txt", "");
    create(writer->thermal_table_, "thermal.csv",
           "# frame,stamp_ns(middle of readout),true_ns,arrival_ns,ffc_state(0 idle 1 in progress 2 "
           "complete),frozen,since_ffc_s,focal_plane_celsius\n");
    create(writer->thermal_truth_, "gt.tum", "");
  }
  if (s.imu_on) create(writer->imu_, "imu.csv", "# timestamp_ns,ax,ay,az [m/s^2],gx,gy,gz [rad/s] (specific force)\n");
  if (s.gnss_on)
    create(writer->gnss_, "gnss.csv",
           "# timestamp_ns,arrival_ns,fix(0 none 1 single 4 rtk fixed 5 rtk "
           "float),latitude,longitude,altitude,east,north,up,sigma_e,sigma_n,sigma_u\n");
  create(writer->base_, "gt_base.tum", "");
  if (error) return *error;
  if (auto written = writer->write_calibration(); !written) return written.error();
  return writer;
}

Result<void> FolderWriter::write_calibration() {
  const Scenario& s = simulation_.scenario();
  const CameraModel& m = s.thermal.camera;
  if (s.thermal_on) {
    std::ofstream calib(folder_ + "/calib.txt");
    calib << std::setprecision(12) << m.fx << ' ' << m.fy << ' ' << m.cx << ' ' << m.cy << ' ' << m.width << ' '
          << m.height << '\n';
    calib << m.k1 << ' ' << m.k2 << ' ' << m.p1 << ' ' << m.p2 << ' ' << m.k3 << '\n';
    if (!calib) return Error{ErrorCode::io, folder_ + "/calib.txt: cannot be written"};
  }
  std::ofstream rig(folder_ + "/extrinsics.yaml");
  rig << "# 4x4 matrices T_a_b: coordinates in b to coordinates in a. thermal is the optical frame (z forward).\n";
  write_matrix(rig, "T_base_lidar", s.rig.lidar);
  write_matrix(rig, "T_base_thermal", s.rig.thermal);
  write_matrix(rig, "T_base_imu", s.rig.imu);
  write_matrix(rig, "T_thermal_lidar", s.rig.thermal.inverse() * s.rig.lidar);
  rig << "antenna: [" << s.rig.antenna.x() << ", " << s.rig.antenna.y() << ", " << s.rig.antenna.z() << "]\n";
  rig << "thermal_row_time: " << s.thermal.row_time << "\nthermal_time_constant: " << s.thermal.time_constant << '\n';
  rig << "counts_per_kelvin: " << s.thermal.counts_per_kelvin << '\n';
  if (!rig) return Error{ErrorCode::io, folder_ + "/extrinsics.yaml: cannot be written"};
  return {};
}

void FolderWriter::on_lidar(const LidarScan& scan, const Delivery& delivery) {
  cloud_.values.clear();
  for (int c = 0; c < scan.columns; ++c) {  // in the order of time
    for (int r = 0; r < scan.rings; ++r) {
      const std::size_t i =
          static_cast<std::size_t>(r) * static_cast<std::size_t>(scan.columns) + static_cast<std::size_t>(c);
      if (scan.ranges[i] <= 0.0F) continue;
      const Eigen::Vector3f& p = scan.points[i];
      cloud_.values.insert(cloud_.values.end(), {p.x(), p.y(), p.z(), scan.reflectivity[i],
                                                 1e-9F * static_cast<float>(scan.time_ns[i]), static_cast<float>(r)});
    }
  }
  const std::string name = numbered(scans_++, ".bin");
  cloud_.points = cloud_.values.size() / 6;
  if (auto written = dataset::write_bin(folder_ + "/scans/" + name, cloud_); !written) error_ = written.error();
  scan_index_ << name << ' ' << delivery.stamp_ns << ' ' << cloud_.points << '\n';
  const Scenario& s = simulation_.scenario();
  const double begin = delivery.time - s.epoch;
  const double sweep = 1.0 / s.lidar.rate;
  lidar_start_ << tum_line({nanoseconds(delivery.time), simulation_.lidar(begin)}) << '\n';
  lidar_middle_ << tum_line({nanoseconds(delivery.time), simulation_.lidar(begin + 0.5 * sweep)}) << '\n';
  lidar_end_ << tum_line({nanoseconds(delivery.time), simulation_.lidar(begin + sweep)}) << '\n';
}

void FolderWriter::on_thermal(const ThermalImage& image, const Delivery& delivery) {
  const std::string path = folder_ + "/images/" + numbered(images_, ".png");
  image_.width = static_cast<std::uint32_t>(image.width);
  image_.height = static_cast<std::uint32_t>(image.height);
  image_.pixels = image.counts;
  if (auto written = dataset::write_png16(path, image_); !written) error_ = written.error();
  times_ << images_ << ' ' << std::setprecision(15) << static_cast<double>(delivery.stamp_ns) * 1e-9 << '\n';
  thermal_table_ << images_ << ',' << delivery.stamp_ns << ',' << nanoseconds(delivery.time) << ','
                 << delivery.arrival_ns << ',' << static_cast<int>(image.ffc) << ','
                 << (image.frozen || delivery.repeated ? 1 : 0) << ',' << image.since_ffc << ','
                 << image.focal_plane_celsius << '\n';
  thermal_truth_ << tum_line(
                        {nanoseconds(delivery.time), simulation_.thermal(delivery.time - simulation_.scenario().epoch)})
                 << '\n';
  ++images_;
}

void FolderWriter::on_imu(const ImuSample& sample, const Delivery& /*delivery*/) {
  imu_ << std::setprecision(9) << sample.stamp_ns << ',' << sample.acceleration.x() << ',' << sample.acceleration.y()
       << ',' << sample.acceleration.z() << ',' << sample.rate.x() << ',' << sample.rate.y() << ',' << sample.rate.z()
       << '\n';
}

void FolderWriter::on_gnss(const GnssSample& g, const Delivery& delivery) {
  gnss_ << std::setprecision(12) << g.stamp_ns << ',' << delivery.arrival_ns << ',' << static_cast<int>(g.fix) << ','
        << g.latitude << ',' << g.longitude << ',' << g.altitude << ',' << g.enu.x() << ',' << g.enu.y() << ','
        << g.enu.z() << ',' << g.sigma.x() << ',' << g.sigma.y() << ',' << g.sigma.z() << '\n';
}

void FolderWriter::on_truth(double time, const Pose& world_base) {
  base_ << tum_line({nanoseconds(time), world_base}) << '\n';
}

Result<void> FolderWriter::finish() {
  if (error_) return *error_;
  for (std::ofstream* stream : {&scan_index_, &lidar_start_, &lidar_middle_, &lidar_end_, &times_, &thermal_table_,
                                &thermal_truth_, &imu_, &gnss_, &base_}) {
    if (!stream->is_open()) continue;
    stream->flush();
    if (!*stream) return Error{ErrorCode::io, folder_ + ": writing failed"};
  }
  return {};
}

}  // namespace adit::tunnel_simulator
