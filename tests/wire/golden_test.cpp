// Against messages, hashes and discovery samples captured from real ROS 2 (Humble and Jazzy).
#include <gmock/gmock.h>

#include <fstream>
#include <iostream>
#include <iterator>
#include <map>
#include <set>
#include <string>

#include <nlohmann/json.hpp>

#include "idl/type_registry.hpp"
#include "tests/wire/shared_data.hpp"

namespace adit {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

std::string read(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

Bytes bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text));
}

std::string text_of(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

class Golden : public testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(folder_)) GTEST_SKIP() << "skipped: no shared data";
  }
  // Every captured message below `folder`, with its description and the type that the ROS version has.
  template <class Use>
  static void for_each_message(const fs::path& folder, std::string_view discovery_variant, const Use& use) {
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (entry.path().extension() != ".cdr") continue;
      const json description = json::parse(read(fs::path(entry.path()).replace_extension(".json")));
      const std::string name = description["type"];
      const std::string file = entry.path().filename();
      const bool gid_differs = name == "rmw_dds_common/msg/ParticipantEntitiesInfo";
      const bool jazzy = file.find("jazzy") != std::string::npos;
      SCOPED_TRACE(file);
      const MessageType* type = find_type(name, gid_differs && !jazzy ? discovery_variant : "");
      ASSERT_NE(type, nullptr) << name;
      use(*type, read(entry.path()), description, file);
    }
  }
  fs::path folder_ = test::shared_folder() / "golden";
};

TEST_F(Golden, MessagesDecodeToTheirJsonAndEncodeToTheSameBytes) {
  int messages = 0;
  std::set<std::string_view> types;
  const auto check = [&](const MessageType& type, const std::string& payload, const json& description,
                         const std::string& file) {
    if (file.starts_with("ros_discovery_info")) return;
    std::string text;
    ASSERT_EQ(type.to_json(bytes_of(payload), text, {}), DecodeStatus::ok);
    EXPECT_EQ(json::parse(text), description["value"]);
    std::vector<std::byte> again;
    ASSERT_EQ(type.reencode(bytes_of(payload), again), DecodeStatus::ok);
    EXPECT_TRUE(text_of(again) == payload);
    EXPECT_EQ(type.info->dds_name, description["dds_type"]);
    ++messages;
    types.insert(type.info->ros_name);
  };
  for_each_message(folder_, "humble", check);
  EXPECT_EQ(messages, 300);
  EXPECT_EQ(types.size(), 60u);
  std::cout << messages << " messages of " << types.size()
            << " types decode to their JSON and encode to the same bytes\n";
  for_each_message(folder_ / "jazzy", "", check);
  EXPECT_EQ(messages, 305);
  std::cout << messages - 300 << " of Jazzy's ParticipantEntitiesInfo too\n";
}

TEST_F(Golden, EveryTruncationOfEveryMessageIsRejected) {
  std::size_t rejected = 0;
  for_each_message(folder_, "humble",
                   [&](const MessageType& type, const std::string& payload, const json&, const std::string&) {
                     std::string text;
                     const std::size_t stride = payload.size() / 200 + 1;
                     for (std::size_t size = 0; size < payload.size() - 8; size += stride, ++rejected) {
                       const std::string cut = payload.substr(0, size);
                       EXPECT_NE(type.to_json(bytes_of(cut), text, {}), DecodeStatus::ok) << size;
                     }
                     EXPECT_EQ(text, "");
                   });
  std::cout << rejected << " truncated payloads rejected\n";
}

TEST_F(Golden, TypeHashesAreThoseOfRos) {
  std::map<std::string, std::string, std::less<>> hashes;
  std::ifstream file(folder_ / "type_hashes.txt");
  for (std::string name, hash; file >> name;) {
    if (name.starts_with('#')) {
      std::getline(file, name);
    } else if (file >> hash) {
      hashes[name] = hash;
    }
  }
  int equal = 0;
  std::set<std::string_view> ours;
  for (const MessageType& type : all_types()) {
    if (!type.variant.empty()) continue;  // Humble has no hashes
    const auto found = hashes.find(type.info->ros_name);
    if (found == hashes.end()) {
      ours.insert(type.info->ros_name.substr(0, type.info->ros_name.find('/')));
      continue;
    }
    EXPECT_EQ(type.info->type_hash, found->second) << type.info->ros_name;
    ++equal;
  }
  EXPECT_THAT(ours, testing::ElementsAre("adit_msgs"));
  EXPECT_GE(equal, 102);
  std::cout << equal << " type hashes equal Jazzy's\n";
}

TEST_F(Golden, DiscoverySamplesOfBothVersions) {
  int samples = 0;
  for_each_message(
      folder_, "humble",
      [&](const MessageType& type, const std::string& payload, const json& description, const std::string& name) {
        if (!name.starts_with("ros_discovery_info")) return;
        std::string text;
        ASSERT_EQ(type.to_json(bytes_of(payload), text, {}), DecodeStatus::ok);
        EXPECT_EQ(json::parse(text), description["value"]);
        std::vector<std::byte> again;
        ASSERT_EQ(type.reencode(bytes_of(payload), again), DecodeStatus::ok);
        // Fast DDS leaves its padding uninitialized, so only what it means must be equal.
        std::string second;
        ASSERT_EQ(type.to_json(again, second, {}), DecodeStatus::ok);
        EXPECT_EQ(second, text);
        const bool fast_dds = name.find("fastrtps") != std::string::npos;
        EXPECT_TRUE(fast_dds || payload.starts_with(text_of(again)));
        ++samples;
      });
  EXPECT_EQ(samples, 3);
}

TEST_F(Golden, SchemaTextHasTheFieldsOfTheMessage) {
  for_each_message(folder_, "humble",
                   [&](const MessageType& type, const std::string&, const json& description, const std::string&) {
                     const std::string schema(type.info->schema.substr(0, type.info->schema.find("====")));
                     for (const auto& field : description["value"].items()) {
                       EXPECT_THAT(schema, testing::HasSubstr(" " + field.key()));
                     }
                   });
}

}  // namespace
}  // namespace adit
