#include <fmt/format.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "adit_msgs/msg/fusion_status.hpp"
#include "components/runtime/component.hpp"
#include "components/runtime/stamp.hpp"

namespace adit {
namespace {

class FusionStatusWriterComponent final : public Component {
  using FusionStatus = adit_msgs::msg::FusionStatus;

  Param<std::string> path_{*this, "path", std::string("fusion.csv"), "the file to write"};
  Param<double> period_{*this, "period", 0.05, Unit::second, Range{0.0, 60.0}, "at most one line in this time"};
  Input<FusionStatus> status_{*this, "status", Qos::reliable(100), Queue{1000, WhenFull::drop_oldest},
                              [this](const FusionStatus& message, const MessageInfo&) { write(message); }};
  std::ofstream file_;
  Time last_{};

  Result<void> configure() override {
    const std::filesystem::path path(path_.value());
    std::error_code ignored;
    if (path.has_parent_path()) std::filesystem::create_directories(path.parent_path(), ignored);
    file_.open(path, std::ios::trunc);
    if (!file_) return Error{ErrorCode::io, path.string() + ": cannot write: " + std::strerror(errno)};
    file_ << "# stamp,mode,thermal_scale,thermal_scale_sigma, of each sensor: "
             "name,nis,dof,nis_mean,accepted,rejected,late,dropped\n";
    return {};
  }

  Result<void> cleanup() override {
    file_.close();
    last_ = {};
    return {};
  }

  void on_time_jump(Duration) override { last_ = {}; }

  void write(const FusionStatus& message) {
    const Time stamp = to_time(message.header.stamp);
    if (stamp - last_ < Duration(static_cast<Duration::rep>(1e9 * period_))) return;
    last_ = stamp;
    const std::int64_t ns = stamp.time_since_epoch().count();
    file_ << fmt::format("{}.{:09d},{},{:.6f},{:.6f}", ns / 1'000'000'000, ns % 1'000'000'000, message.mode,
                         message.thermal_scale, message.thermal_scale_sigma);
    for (const auto& s : message.sensors) {
      file_ << fmt::format(",{},{:.6g},{},{:.6g},{},{},{},{}", s.name, s.nis, s.degrees_of_freedom, s.nis_mean,
                           s.accepted, s.rejected, s.late, s.dropped);
    }
    file_ << '\n' << std::flush;
    if (!file_) health(Health::error, path_.value() + ": cannot write: " + std::strerror(errno));
  }
};

ADIT_COMPONENT(FusionStatusWriterComponent, "fusion_status_writer");

}  // namespace
}  // namespace adit
