#include "tests/benchmarks/runtime_side.hpp"

#include <cstdio>
#include <thread>

#include "components/runtime/component.hpp"
#include "components/runtime/process.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"

namespace adit::bench {
namespace {

using sensor_msgs::msg::PointCloud2;
using sensor_msgs::msg::PointField;

constexpr std::int64_t second = 1'000'000'000;

// Publishes when the measurement says so, not by a timer.
class CloudSource final : public Component {
 public:
  CloudSource() { instance = this; }
  static CloudSource* instance;

  bool matched() const { return cloud_.stats().link.matched > 0; }
  // A cloud as a LiDAR driver fills it; only the points themselves are left as they are.
  bool send(std::size_t bytes) {
    Loan<PointCloud2> loan = cloud_.loan();
    loan->header.frame_id = "lidar";
    loan->fields.resize(4);
    for (std::size_t i = 0; i < 4; ++i) {
      constexpr const char* names[] = {"x", "y", "z", "intensity"};
      loan->fields[i].name = names[i];
      loan->fields[i].offset = static_cast<std::uint32_t>(4 * i);
      loan->fields[i].datatype = PointField::FLOAT32;
      loan->fields[i].count = 1;
    }
    loan->point_step = 16;
    loan->height = 1;
    loan->width = static_cast<std::uint32_t>(bytes / 16);
    loan->row_step = loan->width * 16;
    loan->is_dense = true;
    loan->data.resize(bytes);
    const std::int64_t now = monotonic_ns();
    loan->header.stamp.sec = static_cast<std::int32_t>(now / second);
    loan->header.stamp.nanosec = static_cast<std::uint32_t>(now % second);
    return cloud_.publish(std::move(loan));
  }

 private:
  Output<PointCloud2> cloud_{*this, "cloud", Qos::reliable(10)};
};
CloudSource* CloudSource::instance = nullptr;
ADIT_COMPONENT(CloudSource, "adit_bench_source");

class CloudSink final : public Component {
 public:
  static OnMessage on_message;
  static std::uint64_t* copied;

 private:
  Input<PointCloud2> cloud_{*this, "cloud", Qos::reliable(10), Queue{10, WhenFull::drop_oldest},
                            [](const PointCloud2& cloud, const MessageInfo&) {
                              if (!cloud.data.is_view()) ++*copied;
                              on_message(cloud.header.stamp.sec * second + cloud.header.stamp.nanosec);
                            }};
};
OnMessage CloudSink::on_message;
std::uint64_t* CloudSink::copied = nullptr;
ADIT_COMPONENT(CloudSink, "adit_bench_sink");

class RunningProcess {
 public:
  RunningProcess(const std::string& vendor, std::uint32_t domain, const std::string& type) {
    ProcessConfig config;
    config.name = type;
    config.middleware.vendor = vendor;
    config.middleware.domain = domain;
    config.log_level = LogLevel::warn;
    ComponentConfig component;
    component.type = type;
    component.name = "bench";
    config.components = {component};
    auto built = Process::build(config);
    if (!built) {
      failed(built.error());
      return;
    }
    process_ = std::move(*built);
    auto connected = process_->open();
    if (connected) connected = process_->start();
    if (!connected) {
      failed(connected.error());
      return;
    }
    running_ = std::jthread([this](std::stop_token stop) { process_->run(stop); });
  }
  ~RunningProcess() {
    if (running_.joinable()) {
      running_.request_stop();
      running_.join();
    }
    if (process_) process_->shutdown();
  }
  bool valid() const { return running_.joinable(); }

 private:
  void failed(const Error& error) { std::fprintf(stderr, "%s\n", error.message.c_str()); }
  std::unique_ptr<Process> process_;
  std::jthread running_;
};

class RuntimeSender final : public Sender {
 public:
  RuntimeSender(const std::string& vendor, std::uint32_t domain, std::size_t bytes)
      : bytes_(bytes), process_(vendor, domain, "adit_bench_source") {}
  bool valid() const { return process_.valid(); }
  bool matched() const override { return CloudSource::instance->matched(); }
  bool send() override { return CloudSource::instance->send(bytes_); }

 private:
  const std::size_t bytes_;
  RunningProcess process_;
};

class RuntimeReceiver final : public Receiver {
 public:
  RuntimeReceiver(const std::string& vendor, std::uint32_t domain) : process_(vendor, domain, "adit_bench_sink") {}
  bool valid() const { return process_.valid(); }

 private:
  RunningProcess process_;
};

}  // namespace

std::unique_ptr<Sender> make_runtime_sender(const std::string& vendor, std::uint32_t domain, std::size_t bytes) {
  auto sender = std::make_unique<RuntimeSender>(vendor, domain, bytes);
  if (!sender->valid()) return nullptr;
  return sender;
}

std::unique_ptr<Receiver> make_runtime_receiver(const std::string& vendor, std::uint32_t domain, std::uint64_t& copied,
                                                OnMessage on_message) {
  CloudSink::copied = &copied;
  CloudSink::on_message = std::move(on_message);
  auto receiver = std::make_unique<RuntimeReceiver>(vendor, domain);
  if (!receiver->valid()) return nullptr;
  return receiver;
}

}  // namespace adit::bench
