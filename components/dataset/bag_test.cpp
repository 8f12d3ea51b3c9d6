#include <gmock/gmock.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "components/dataset/bag_qos.hpp"
#include "components/dataset/bag_reader.hpp"
#include "components/dataset/bag_writer.hpp"

namespace adit::dataset {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class Bag : public ::testing::Test {
 protected:
  fs::path folder_ = fs::temp_directory_path() / ("adit_bag_" + std::to_string(::getpid()));
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  std::string path(const char* name) const { return (folder_ / name).string(); }
  static std::vector<std::byte> payload(std::size_t size, int seed) {
    std::vector<std::byte> out(size);
    for (std::size_t i = 0; i < size; ++i)
      out[i] = static_cast<std::byte>((i * 31 + static_cast<std::size_t>(seed)) % 251);
    return out;
  }
  static std::string read(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  // A shared data folder, or a skip.
  static fs::path real(const char* name) {
    const char* shared = std::getenv("ADIT_SHARED");
    return fs::path(shared != nullptr ? shared : ADIT_SOURCE_DIR "/../shared") / "data/rosbag2_real" / name;
  }
};

const BagTopic kPoints{"/lidar/points", "sensor_msgs/msg/PointCloud2", bag_qos_text({BagQos{}}), "RIHS01_aa",
                       "uint32 x\n"};
const BagTopic kRig{"/tf_static", "tf2_msgs/msg/TFMessage", bag_qos_text({{true, true, 1}}), "RIHS01_bb",
                    "string \"quoted\" \\ text"};

// Two topics, samples out of order, one of 3 MB.
void write_bag(const std::string& folder, int seed, const std::vector<std::byte>& large,
               std::vector<std::byte> (*payload)(std::size_t, int)) {
  auto writer = BagWriter::create(folder);
  ASSERT_TRUE(writer) << writer.error().message;
  const auto points = (*writer)->add_topic(kPoints);
  const auto rig = (*writer)->add_topic(kRig);
  ASSERT_TRUE(points && rig);
  EXPECT_EQ(*(*writer)->add_topic(kPoints), *points);
  BagTopic wrong = kPoints;
  wrong.type = "std_msgs/msg/String";
  EXPECT_FALSE((*writer)->add_topic(wrong));
  ASSERT_TRUE((*writer)->write({*points, 3000, payload(40, seed)}));
  ASSERT_TRUE((*writer)->write({*rig, 1000, payload(8, seed)}));
  ASSERT_TRUE((*writer)->write({*points, 2000, large}));
  EXPECT_FALSE((*writer)->write({7, 2000, large}));
  ASSERT_TRUE((*writer)->close());
  EXPECT_FALSE((*writer)->write({*points, 2000, large}));
}

TEST_F(Bag, ReadsBackWhatWasWritten) {
  const auto large = payload(3'000'000, 1);
  write_bag(path("run"), 5, large, payload);
  for (const char* name : {"run", "run/run_0.db3"}) {
    auto reader = BagReader::open(path(name));
    ASSERT_TRUE(reader) << reader.error().message;
    const BagInfo& info = (*reader)->info();
    ASSERT_EQ(info.topics.size(), 2U);
    for (std::size_t i = 0; i < 2; ++i) {
      const BagTopic& expected = i == 0 ? kPoints : kRig;
      EXPECT_EQ(info.topics[i].name, expected.name);
      EXPECT_EQ(info.topics[i].type, expected.type);
      EXPECT_EQ(info.topics[i].qos, expected.qos);
      EXPECT_EQ(info.topics[i].type_hash, expected.type_hash);
      EXPECT_EQ(info.topics[i].schema, expected.schema);
    }
    EXPECT_THAT(info.counts, testing::ElementsAre(2, 1));
    EXPECT_EQ(info.first_ns, 1000);
    EXPECT_EQ(info.last_ns, 3000);
    BagSample sample;
    const std::vector<std::pair<std::size_t, std::vector<std::byte>>> expected{
        {1, payload(8, 5)}, {0, large}, {0, payload(40, 5)}};
    for (std::size_t i = 0; i < expected.size(); ++i) {
      ASSERT_TRUE(*(*reader)->next(sample));
      EXPECT_EQ(sample.topic, expected[i].first);
      EXPECT_EQ(sample.stamp_ns, 1000 * static_cast<std::int64_t>(i + 1));
      EXPECT_TRUE(std::ranges::equal(sample.cdr, expected[i].second));
    }
    EXPECT_FALSE(*(*reader)->next(sample));
    EXPECT_FALSE(*(*reader)->next(sample));
    ASSERT_TRUE((*reader)->select({"/lidar/points", "/not/there"}));
    ASSERT_TRUE(*(*reader)->next(sample));
    EXPECT_EQ(sample.stamp_ns, 2000);
    ASSERT_TRUE(*(*reader)->next(sample));
    EXPECT_FALSE(*(*reader)->next(sample));
  }
  // What ROS 2's own reader looks for (metadata version 8, schema 4).
  const std::string metadata = read(folder_ / "run/metadata.yaml");
  for (const char* line :
       {"rosbag2_bagfile_information:\n  version: 8\n", "  storage_identifier: sqlite3\n", "    nanoseconds: 2000\n",
        "    nanoseconds_since_epoch: 1000\n", "  message_count: 3\n", "        name: /tf_static\n",
        "      message_count: 1\n", "    - run_0.db3\n",
        "offered_qos_profiles: \"- history: 1\\n  depth: 1\\n  reliability: 1\\n  durability: 1\\n"}) {
    EXPECT_THAT(metadata, HasSubstr(line));
  }
}

TEST_F(Bag, SameCallsSameBytes) {
  const auto large = payload(3'000'000, 1);
  write_bag(path("a/run"), 5, large, payload);
  write_bag(path("b/run"), 5, large, payload);
  write_bag(path("b/run"), 5, large, payload);  // replaced, not appended
  write_bag(path("c/run"), 6, large, payload);
  EXPECT_EQ(read(path("a/run/run_0.db3")), read(path("b/run/run_0.db3")));
  EXPECT_EQ(read(path("a/run/metadata.yaml")), read(path("b/run/metadata.yaml")));
  EXPECT_NE(read(path("a/run/run_0.db3")), read(path("c/run/run_0.db3")));
}

// The files as they are while the recording goes on, in another folder: what a power cut would leave.
TEST_F(Bag, CommittedSamplesOutliveTheirWriter) {
  auto writer = BagWriter::create(path("run"), BagWriter::Safety::each_commit);
  ASSERT_TRUE(writer) << writer.error().message;
  const std::size_t points = *(*writer)->add_topic(kPoints);
  for (int i = 0; i < 20; ++i) ASSERT_TRUE((*writer)->write({points, i, payload(100'000, i)}));
  ASSERT_TRUE((*writer)->commit());
  ASSERT_TRUE((*writer)->write({points, 20, payload(100'000, 20)}));  // not committed
  fs::copy(path("run"), path("cut"));
  auto cut = BagReader::open(path("cut"));
  ASSERT_TRUE(cut) << cut.error().message;
  EXPECT_EQ((*cut)->info().samples, 20U);
  BagSample sample;
  for (int i = 0; i < 20; ++i) {
    ASSERT_TRUE(*(*cut)->next(sample));
    EXPECT_TRUE(std::ranges::equal(sample.cdr, payload(100'000, i)));
  }
  ASSERT_TRUE((*writer)->close());
  auto whole = BagReader::open(path("run"));
  ASSERT_TRUE(whole) << whole.error().message;
  EXPECT_EQ((*whole)->info().samples, 21U);
  std::vector<std::string> files;
  for (const auto& entry : fs::directory_iterator(path("run"))) files.push_back(entry.path().filename().string());
  EXPECT_THAT(files, testing::UnorderedElementsAre("metadata.yaml", "run_0.db3"));
}

TEST(BagQos, SurvivesTheText) {
  for (const BagQos& qos : {BagQos{}, BagQos{false, false, 5}, BagQos{true, true, 1}, BagQos{true, false, 0}}) {
    const Result<BagQos> read = bag_qos_offer(bag_qos_text({qos}));
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(*read, qos);
  }
}

TEST(BagQos, OffersWhatServesTheReadersOfEveryWriter) {
  const std::string text = bag_qos_text({{false, false, 5}, {true, true, 3}, {false, false, 5}});
  const auto offer = bag_qos_offer(text);
  ASSERT_TRUE(offer) << offer.error().message;
  EXPECT_EQ(*offer, (BagQos{true, true, 5}));
  EXPECT_EQ(text.rfind("- history"), text.find("- history", 1)) << "a profile is written once";
}

TEST(BagQos, ReadsWordsAndRefusesNonsense) {
  const auto words = bag_qos_offer(
      "- history: keep_all\n  depth: 0\n  reliability: best_effort\n  durability: transient_local\n  liveliness: "
      "automatic");
  ASSERT_TRUE(words) << words.error().message;
  EXPECT_EQ(*words, (BagQos{false, true, 0}));
  EXPECT_EQ(*bag_qos_offer(""), BagQos{});
  EXPECT_EQ(*bag_qos_offer("[]"), BagQos{});
  EXPECT_FALSE(bag_qos_offer("- depth: many"));
  EXPECT_FALSE(bag_qos_offer("reliable"));
  EXPECT_FALSE(bag_qos_offer("- {"));
}

TEST_F(Bag, RefusesWhatIsNotABag) {
  const auto message = [](const std::string& path) {
    const auto reader = BagReader::open(path);
    return reader ? std::string() : reader.error().message;
  };
  EXPECT_THAT(message(path("nowhere")), HasSubstr("no such file"));
  EXPECT_THAT(message(folder_.string()), HasSubstr("no bag"));
  std::ofstream(path("text.db3"))
      << "this is no database, and long enough that SQLite says so when it reads the header";
  EXPECT_THAT(message(path("text.db3")), HasSubstr("not a database"));
  const auto with_metadata = [&](const std::string& text) {
    std::ofstream(path("metadata.yaml")) << "rosbag2_bagfile_information:\n" << text;
    return message(folder_.string());
  };
  EXPECT_THAT(with_metadata("  storage_identifier: mcap\n"), HasSubstr("metadata.yaml:2: storage 'mcap'"));
  EXPECT_THAT(with_metadata("  compression_mode: FILE\n"), HasSubstr("compressed"));
  EXPECT_THAT(with_metadata("  version: 8\n"), HasSubstr("names no files"));
  EXPECT_THAT(with_metadata("  relative_file_paths: [gone.db3]\n"), HasSubstr("gone.db3: no such file"));
  // A database cut in the middle: an error, no crash, no endless loop.
  write_bag(path("run"), 5, payload(3'000'000, 1), payload);
  fs::resize_file(path("run/run_0.db3"), 1'000'000);
  auto reader = BagReader::open(path("run"));
  BagSample sample;
  bool failed = !reader;
  for (int i = 0; !failed && i < 10; ++i) {
    const auto next = (*reader)->next(sample);
    failed = !next;
    if (next && !*next) break;
  }
  EXPECT_TRUE(failed);
}

TEST_F(Bag, ReadsBagsOfRos) {
  if (!fs::exists(real(""))) GTEST_SKIP() << "skipped: no shared data";
  struct Expected {
    const char* path;
    std::size_t topics;
    std::uint64_t samples;
    const char* type;
  };
  for (const Expected& e :
       {Expected{"nebula_vlp16/1673400471837873222", 1, 4, "velodyne_msgs/msg/VelodyneScan"},
        Expected{"nebula_xt32/1673400677802009732", 1, 4, "pandar_msgs/msg/PandarScan"},
        Expected{"rosbag2_upstream/rosbag2_tests/resources/sqlite3/cdr_test", 2, 7, "test_msgs/msg/BasicTypes"},
        Expected{"rosbag2_upstream/rosbag2_py/test/resources/sqlite3/talker", 3, 20, "std_msgs/msg/String"},
        Expected{"rosbag2_upstream/rosbag2_py/test/resources/sqlite3/wbag", 8, 6074, "std_msgs/msg/String"},
        Expected{"rosbag2_upstream/rosbag2_py/test/resources/sqlite3/reindex_test_bags/multiple_files", 1, 3177,
                 "std_msgs/msg/String"},
        Expected{"rosbag2_upstream/rosbag2_cpp/test/rosbag2_cpp/bags/topics_and_services.db3", 5, 13,
                 "rcl_interfaces/msg/ParameterEvent"}}) {
    auto reader = BagReader::open(real(e.path).string());
    ASSERT_TRUE(reader) << reader.error().message;
    const BagInfo& info = (*reader)->info();
    EXPECT_EQ(info.topics.size(), e.topics) << e.path;
    EXPECT_EQ(info.samples, e.samples) << e.path;
    EXPECT_TRUE(std::ranges::any_of(info.topics, [&](const BagTopic& t) { return t.type == e.type; })) << e.path;
    BagSample sample;
    std::uint64_t count = 0;
    while (*(*reader)->next(sample)) {
      ++count;
      ASSERT_GE(sample.cdr.size(), 4U);
      EXPECT_EQ(sample.cdr[0], std::byte{0});
      EXPECT_EQ(sample.cdr[1], std::byte{1});  // little-endian CDR
      EXPECT_GE(sample.stamp_ns, info.first_ns);
      EXPECT_LE(sample.stamp_ns, info.last_ns);
    }
    EXPECT_EQ(count, e.samples) << e.path;
  }
}

}  // namespace
}  // namespace adit::dataset
