// Encode and decode: time, bytes a second, allocations a message once the memory has grown.
#include "idl/codec.hpp"

#include "idl/testing/allocation_counter.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "nav_msgs/msg/path.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"
#include "std_msgs/msg/header.hpp"
#include "tests/benchmarks/bench.hpp"

namespace adit::bench {
namespace {

void report(benchmark::State& state, std::size_t bytes, std::uint64_t allocations) {
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(bytes));
  state.counters["bytes"] = static_cast<double>(bytes);
  state.counters["allocations/message"] =
      static_cast<double>(allocations) /
      static_cast<double>(std::max<benchmark::IterationCount>(1, state.iterations()));
}

template <Message T>
void encode_message(benchmark::State& state, const T& message) {
  std::vector<std::byte> out(encoded_size(message));
  const std::uint64_t before = test::allocations_of_this_thread();
  for (auto _ : state) {
    if (encode(message, out) == 0) return fail(state, "does not encode");
    benchmark::DoNotOptimize(out.data());
    benchmark::ClobberMemory();
  }
  report(state, out.size(), test::allocations_of_this_thread() - before);
}

template <Message T>
void decode_message(benchmark::State& state, const T& message, bool view) {
  std::vector<std::byte> bytes(encoded_size(message));
  encode(message, bytes);
  static constexpr KeepAliveOperations nothing{[](void*) noexcept {}, [](void*) noexcept {}};
  int owner = 0;
  T decoded;
  const auto decode_once = [&] {
    return decode(bytes, decoded, view ? KeepAlive(&nothing, &owner) : KeepAlive{}) == DecodeStatus::ok;
  };
  decode_once();
  const std::uint64_t before = test::allocations_of_this_thread();
  for (auto _ : state) {
    if (!decode_once()) return fail(state, "does not decode");
    benchmark::DoNotOptimize(&decoded);
    benchmark::ClobberMemory();
  }
  report(state, bytes.size(), test::allocations_of_this_thread() - before);
}

std_msgs::msg::Header header() {
  std_msgs::msg::Header header;
  header.stamp.sec = 1'700'000'000;
  header.frame_id = "base_link";
  return header;
}

nav_msgs::msg::Odometry odometry() {
  nav_msgs::msg::Odometry odometry;
  odometry.header = header();
  odometry.child_frame_id = "lidar";
  return odometry;
}

nav_msgs::msg::Path path() {
  nav_msgs::msg::Path path;
  path.header = header();
  path.poses.resize(1000);
  for (auto& pose : path.poses) pose.header = header();
  return path;
}

sensor_msgs::msg::PointCloud2 cloud() {
  sensor_msgs::msg::PointCloud2 cloud;
  cloud.header = header();
  cloud.fields.resize(4);
  for (auto& field : cloud.fields) field.name = "x";
  cloud.data.resize(4'000'000);
  std::fill_n(cloud.data.mutable_data(), cloud.data.size(), std::uint8_t{7});
  return cloud;
}

template <Message T>
void register_type(const std::string& name, T (*make)()) {
  benchmark::RegisterBenchmark(("codec/" + name + "/encode").c_str(),
                               [make](benchmark::State& state) { encode_message(state, make()); });
  benchmark::RegisterBenchmark(("codec/" + name + "/decode_copy").c_str(),
                               [make](benchmark::State& state) { decode_message(state, make(), false); });
}

}  // namespace

void register_codec() {
  register_type("Header", header);
  register_type("Odometry", odometry);
  register_type("Path_1000", path);
  register_type("PointCloud2_4MB", cloud);
  benchmark::RegisterBenchmark("codec/PointCloud2_4MB/decode_view",
                               [](benchmark::State& state) { decode_message(state, cloud(), true); });
}

}  // namespace adit::bench
