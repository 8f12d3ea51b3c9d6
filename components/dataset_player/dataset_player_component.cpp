#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "components/dataset/cloud_folder.hpp"
#include "components/dataset_player/recorded_messages.hpp"
#include "components/runtime/component.hpp"
#include "components/runtime/stamp.hpp"
#include "rosgraph_msgs/msg/clock.hpp"

namespace adit {
namespace {

using adit_msgs::msg::ThermalFrame;
using nav_msgs::msg::Odometry;
using sensor_msgs::msg::Image;
using sensor_msgs::msg::PointCloud2;

class DatasetPlayerComponent final : public Component {
  Param<std::string> folder_{*this, "folder", std::string(), "folder to play; see components/dataset/README.md"};
  Param<double> rate_{*this, "rate", 1.0, Range{0.0, 1000.0}, "times real time; 0: lockstep with `answer`"};
  Param<double> start_{*this, "start", 0.0, Unit::second, Range{0.0, 1e6}, "skip this much at the beginning"};
  Param<double> end_{*this, "end", 0.0, Unit::second, Range{0.0, 1e6}, "stop here; 0: play to the end"};
  Param<bool> loop_{*this, "loop", false, "start over at the end, stamps going on"};
  Param<double> file_rate_{*this, "file_rate", 10.0, Unit::hertz, Range{0.01, 1000.0}, "of folders without stamps"};
  Param<std::string> frame_id_{*this, "frame_id", std::string("lidar"), "of the messages"};
  Param<std::string> odometry_file_{*this, "odometry_file", std::string(), "TUM file with a pose for every stamp"};
  Param<std::string> odometry_frame_{*this, "odometry_frame", std::string("odom"), "frame of those poses"};
  Param<double> answer_timeout_{*this,        "answer_timeout",  5.0,
                                Unit::second, Range{0.1, 600.0}, "lockstep: go on without an answer after this time"};
  Param<bool> clock_topic_{*this, "clock", false, "publish the stamps on /clock"};

  Output<PointCloud2> points_{*this, "points", Qos::reliable(10)};
  Output<ThermalFrame> frame_{*this, "frame", Qos::reliable(10)};
  Output<Image> image_{*this, "image_raw", Qos::reliable(10)};
  Output<Odometry> odometry_{*this, "odometry", Qos::reliable(100)};
  Output<rosgraph_msgs::msg::Clock> clock_out_{*this, "/clock", Qos::clock()};
  Input<Odometry> answer_{
      *this, "answer", Qos::reliable(10), Queue{10, WhenFull::drop_oldest},
      [this](const Odometry& message, const MessageInfo&) { answered(to_time(message.header.stamp)); }};
  Timer tick_{*this, "play", std::chrono::milliseconds(50), [this] { tick(); }};

  dataset::Dataset dataset_;
  Trajectory poses_;
  std::size_t next_ = 0;  // entry that goes out next
  std::uint64_t played_ = 0;
  std::uint64_t unanswered_ = 0;
  int resent_ = 0;  // times the first file went out again
  std::int64_t loop_offset_ns_ = 0;
  bool waiting_for_readers_ = true;
  bool answered_once_ = false;
  bool done_ = false;
  Time last_stamp_{};                                   // of what went out last
  std::chrono::steady_clock::time_point last_time_{};   // when it went out
  std::chrono::steady_clock::time_point first_time_{};  // when the first one of this pass went out

  Result<void> configure() override;
  Result<void> activate() override;
  void tick();
  void answered(Time stamp);
  void play_next();
  Result<void> publish(std::size_t index);
  void schedule();
  void finish_pass();
  void show_progress(bool last);

  bool lockstep() const { return rate_ == 0.0; }
  std::int64_t stamp_ns(std::size_t entry) const { return dataset_.entries[entry].stamp_ns + loop_offset_ns_; }
};

Result<void> DatasetPlayerComponent::configure() {
  if (folder_.value().empty())
    return Error{ErrorCode::invalid_argument, "parameter 'folder' is empty: name a folder to play"};
  Result<dataset::Dataset> dataset = dataset::open_dataset(folder_.value(), file_rate_);
  if (!dataset) return dataset.error();
  dataset_ = *std::move(dataset);
  const std::int64_t first = dataset_.entries.front().stamp_ns;
  const auto outside = [&](const dataset::Entry& entry) {
    const double at = 1e-9 * static_cast<double>(entry.stamp_ns - first);
    return at < start_ || (end_ > 0.0 && at > end_);
  };
  std::erase_if(dataset_.entries, outside);
  if (dataset_.entries.empty()) {
    return Error{ErrorCode::invalid_argument, folder_.value() + ": nothing lies between `start` and `end`"};
  }
  if (loop_ && lockstep()) return Error{ErrorCode::invalid_argument, "`loop` needs a `rate` other than 0"};
  poses_.clear();
  if (odometry_file_.value().empty()) return {};
  Result<Trajectory> poses = read_tum(odometry_file_.value());
  if (!poses) return poses.error();
  poses_ = *std::move(poses);
  return {};
}

Result<void> DatasetPlayerComponent::activate() {
  next_ = 0;
  played_ = unanswered_ = 0;
  resent_ = 0;
  loop_offset_ns_ = 0;
  waiting_for_readers_ = true;
  answered_once_ = done_ = false;
  tick_.set_period(std::chrono::milliseconds(50));
  return {};
}

void DatasetPlayerComponent::tick() {
  if (done_) return;
  if (waiting_for_readers_) {
    const bool read = dataset_.kind == dataset::Dataset::Kind::png16 ? frame_.has_readers() || image_.has_readers()
                                                                     : points_.has_readers();
    health(Health::ok, "waiting for somebody to read");
    if (!read || (!poses_.empty() && !odometry_.has_readers())) return;
    waiting_for_readers_ = false;
    first_time_ = std::chrono::steady_clock::now();
    play_next();
    return;
  }
  if (!lockstep()) return play_next();
  // Lockstep, and no answer yet. The very first file is sent again: who answers may have been found by discovery only
  // after it went out.
  const double waited = std::chrono::duration<double>(std::chrono::steady_clock::now() - last_time_).count();
  if (!answered_once_ && waited > 0.5 * (resent_ + 1) && waited < answer_timeout_) {
    ++resent_;
    if (Result<void> sent = publish(next_ - 1); !sent) log().error("{}", sent.error().message);
    return;
  }
  if (waited < answer_timeout_) return;
  ++unanswered_;
  log().warn("no answer to the file of {} ns within {} s, going on ({} so far)", last_stamp_.time_since_epoch().count(),
             answer_timeout_.value(), unanswered_);
  play_next();
}

void DatasetPlayerComponent::answered(Time stamp) {
  if (!lockstep() || done_ || waiting_for_readers_ || stamp < last_stamp_) return;
  answered_once_ = true;
  play_next();
}

void DatasetPlayerComponent::play_next() {
  if (next_ == dataset_.entries.size()) return finish_pass();
  if (Result<void> sent = publish(next_); !sent) {
    health(Health::error, sent.error().message);
    log().error("{}: left out", sent.error().message);
  } else {
    ++played_;
  }
  last_time_ = std::chrono::steady_clock::now();
  ++next_;
  show_progress(false);
  if (!lockstep()) schedule();
}

Result<void> DatasetPlayerComponent::publish(std::size_t index) {
  const dataset::Entry& entry = dataset_.entries[index];
  const Time stamp(Duration(entry.stamp_ns + loop_offset_ns_));
  last_stamp_ = stamp;
  if (clock_topic_) {
    rosgraph_msgs::msg::Clock clock;
    clock.clock = to_stamp(stamp);
    clock_out_.publish(clock);
  }
  if (const std::optional<Pose> pose = interpolate(poses_, entry.stamp_ns)) {
    Loan<Odometry> odometry = odometry_.loan();
    dataset_player::fill(StampedPose{stamp.time_since_epoch().count(), *pose}, odometry_frame_.value(),
                         frame_id_.value(), *odometry);
    odometry_.publish(std::move(odometry));
  }
  if (dataset_.kind == dataset::Dataset::Kind::png16) {
    const Result<dataset::Image16> image = dataset::read_png16(entry.path);
    if (!image) return image.error();
    Loan<ThermalFrame> frame = frame_.loan();
    dataset_player::fill(*image, stamp, frame_id_.value(), static_cast<std::uint32_t>(played_), *frame);
    frame_.publish(std::move(frame));
    if (image_.has_readers()) {
      Loan<Image> plain = image_.loan();
      dataset_player::fill(*image, stamp, frame_id_.value(), *plain);
      image_.publish(std::move(plain));
    }
    return {};
  }
  const Result<dataset::PointFile> file = dataset::read_cloud(dataset_, index);
  if (!file) return file.error();
  Loan<PointCloud2> cloud = points_.loan();
  dataset_player::fill(*file, stamp, frame_id_.value(), *cloud);
  points_.publish(std::move(cloud));
  return {};
}

// The next file is due at its distance from the first one, so that slow reads do not add up.
void DatasetPlayerComponent::schedule() {
  double due = 0.0;  // [s] after the first one
  if (next_ < dataset_.entries.size()) {
    due = 1e-9 * static_cast<double>(stamp_ns(next_) - stamp_ns(0)) / rate_;
  }
  const double now = std::chrono::duration<double>(std::chrono::steady_clock::now() - first_time_).count();
  tick_.set_period(Duration(std::max<std::int64_t>(1000, std::llround(1e9 * (due - now)))));
}

void DatasetPlayerComponent::finish_pass() {
  if (loop_) {
    const std::size_t count = dataset_.entries.size();
    const std::int64_t span = dataset_.entries.back().stamp_ns - dataset_.entries.front().stamp_ns;
    loop_offset_ns_ += span + (count > 1 ? span / static_cast<std::int64_t>(count - 1) : 100'000'000);
    next_ = 0;
    first_time_ = std::chrono::steady_clock::now();
    return play_next();
  }
  done_ = true;
  show_progress(true);
  log().info("played {} files of {}{}", played_, folder_.value(),
             unanswered_ > 0 ? "; " + std::to_string(unanswered_) + " unanswered" : "");
  finish();
}

void DatasetPlayerComponent::show_progress(bool last) {
  const std::size_t total = dataset_.entries.size();
  health(unanswered_ > 0 ? Health::warn : Health::ok,
         std::to_string(next_) + " of " + std::to_string(total) + " files" +
             (unanswered_ > 0 ? ", " + std::to_string(unanswered_) + " unanswered" : ""));
  // Under a supervisor its table shows the line above.
  if (!::isatty(STDERR_FILENO) || std::getenv("ADIT_SUPERVISOR_FD")) return;
  constexpr std::size_t width = 40;
  const std::string bar(width * next_ / total, '#');
  std::fprintf(stderr, "\r[%-40s] %zu/%zu%s", bar.c_str(), next_, total, last ? "\n" : "");
}

ADIT_COMPONENT(DatasetPlayerComponent, "dataset_player");

}  // namespace
}  // namespace adit
