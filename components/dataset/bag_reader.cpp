#include "components/dataset/bag_reader.hpp"

#include <algorithm>
#include <filesystem>
#include <optional>

#include "components/config/yaml_reader.hpp"
#include "components/dataset/sqlite_file.hpp"

namespace adit::dataset {
namespace {

namespace fs = std::filesystem;

// The files of a bag's folder in their order.
Result<std::vector<std::string>> files_of(const fs::path& folder) {
  const fs::path metadata = folder / "metadata.yaml";
  std::vector<std::string> files;
  if (!fs::exists(metadata)) {
    bool mcap = false;
    std::error_code failed;
    for (const auto& entry : fs::directory_iterator(folder, failed)) {
      if (entry.path().extension() == ".db3") files.push_back(entry.path().string());
      mcap = mcap || entry.path().extension() == ".mcap";
    }
    std::sort(files.begin(), files.end());
    if (!files.empty()) return files;
    return Error{ErrorCode::not_found, folder.string() + ": no bag: neither metadata.yaml nor *.db3" +
                                           (mcap ? " (MCAP storage is not read)" : "")};
  }
  auto document = YamlDocument::load(metadata.string());
  if (!document) return document.error();
  const YamlSection bag = document->root().section("rosbag2_bagfile_information");
  const std::string storage = bag.text("storage_identifier", "sqlite3");
  const std::string compression = bag.text("compression_mode", "");
  if (storage != "sqlite3") {
    return Error{ErrorCode::incompatible,
                 bag.place("storage_identifier") + ": storage '" + storage + "' is not read, only sqlite3"};
  }
  if (!compression.empty() && compression != "NONE" && compression != "none") {
    return Error{ErrorCode::incompatible, bag.place("compression_mode") + ": a compressed bag (" + compression +
                                              ") is not read: decompress it with ros2 bag convert"};
  }
  for (const std::string& file : bag.texts("relative_file_paths", std::vector<std::string>())) {
    files.push_back((folder / file).string());
  }
  if (files.empty()) return Error{ErrorCode::malformed, metadata.string() + ": names no files"};
  return files;
}

}  // namespace

struct BagReader::Impl {
  struct Part {
    SqliteFile file;
    std::vector<std::pair<std::int64_t, std::size_t>> topics;  // the file's id -> index in info.topics
  };
  BagInfo info;
  std::vector<Part> parts;
  std::vector<bool> wanted;
  std::size_t part = 0;
  std::optional<SqliteStatement> rows;

  Result<void> add(const std::string& path);
  Result<void> count(Part& p);
  std::size_t index_of(const BagTopic& topic);
  // Begins reading `part`.
  Result<void> begin();
};

std::size_t BagReader::Impl::index_of(const BagTopic& topic) {
  const auto known =
      std::find_if(info.topics.begin(), info.topics.end(), [&](const auto& t) { return t.name == topic.name; });
  if (known != info.topics.end()) return static_cast<std::size_t>(known - info.topics.begin());
  info.topics.push_back(topic);
  info.counts.push_back(0);
  return info.topics.size() - 1;
}

Result<void> BagReader::Impl::add(const std::string& path) {
  auto file = SqliteFile::open_readonly(path);
  if (!file) return file.error();
  for (const char* table : {"topics", "messages"}) {
    const auto there = file->has_table(table);
    if (!there) return there.error();
    if (!*there) return Error{ErrorCode::malformed, path + ": not a bag: it has no table '" + table + "'"};
  }
  const auto has_qos = file->has_column("topics", "offered_qos_profiles");
  const auto has_hash = file->has_column("topics", "type_description_hash");
  const auto has_schema = file->has_table("message_definitions");
  for (const auto* known : {&has_qos, &has_hash, &has_schema}) {
    if (!*known) return known->error();
  }
  auto topics = file->prepare(
      std::string("SELECT id, name, type, ") + (*has_qos ? "offered_qos_profiles, " : "'', ") +
      (*has_hash ? "type_description_hash, " : "'', ") +
      (*has_schema ? "(SELECT encoded_message_definition FROM message_definitions WHERE topic_type = topics.type)"
                   : "''") +
      " FROM topics ORDER BY id");
  if (!topics) return topics.error();
  Part part_of_file{*std::move(file), {}};
  while (true) {
    const auto row = topics->step();
    if (!row) return row.error();
    if (!*row) break;
    const BagTopic topic{topics->text(1), topics->text(2), topics->text(3), topics->text(4), topics->text(5)};
    part_of_file.topics.emplace_back(topics->integer(0), index_of(topic));
  }
  if (auto counted = count(part_of_file); !counted) return counted;
  parts.push_back(std::move(part_of_file));
  return {};
}

Result<void> BagReader::Impl::count(Part& p) {
  auto rows_of =
      p.file.prepare("SELECT topic_id, COUNT(*), MIN(timestamp), MAX(timestamp) FROM messages GROUP BY topic_id");
  if (!rows_of) return rows_of.error();
  while (true) {
    const auto row = rows_of->step();
    if (!row) return row.error();
    if (!*row) return {};
    const auto number = static_cast<std::uint64_t>(rows_of->integer(1));
    const std::int64_t first = rows_of->integer(2);
    const std::int64_t last = rows_of->integer(3);
    info.first_ns = info.samples == 0 ? first : std::min(info.first_ns, first);
    info.last_ns = info.samples == 0 ? last : std::max(info.last_ns, last);
    info.samples += number;
    for (const auto& [id, index] : p.topics) {
      if (id == rows_of->integer(0)) info.counts[index] += number;
    }
  }
}

Result<void> BagReader::Impl::begin() {
  std::string ids;
  for (const auto& [id, index] : parts[part].topics) {
    if (wanted[index]) ids += (ids.empty() ? "" : ",") + std::to_string(id);
  }
  auto prepared = parts[part].file.prepare("SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN (" + ids +
                                           ") ORDER BY timestamp, id");
  if (!prepared) return prepared.error();
  rows = *std::move(prepared);
  return {};
}

BagReader::BagReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
BagReader::~BagReader() {
  impl_->rows.reset();
}

Result<std::unique_ptr<BagReader>> BagReader::open(const std::string& path) {
  std::vector<std::string> files{path};
  if (fs::is_directory(path)) {
    auto found = files_of(path);
    if (!found) return found.error();
    files = *std::move(found);
  }
  auto impl = std::make_unique<Impl>();
  for (const std::string& file : files) {
    if (auto added = impl->add(file); !added) return added.error();
  }
  std::unique_ptr<BagReader> reader(new BagReader(std::move(impl)));
  if (auto selected = reader->select({}); !selected) return selected.error();
  return reader;
}

const BagInfo& BagReader::info() const {
  return impl_->info;
}

Result<void> BagReader::select(const std::vector<std::string>& names) {
  Impl& d = *impl_;
  d.wanted.assign(d.info.topics.size(), names.empty());
  for (std::size_t i = 0; i < d.wanted.size(); ++i) {
    if (std::find(names.begin(), names.end(), d.info.topics[i].name) != names.end()) d.wanted[i] = true;
  }
  d.part = 0;
  d.rows.reset();
  return d.begin();
}

Result<bool> BagReader::next(BagSample& out) {
  Impl& d = *impl_;
  while (d.part < d.parts.size()) {
    const auto row = d.rows->step();
    if (!row) return row.error();
    if (*row) {
      const std::int64_t id = d.rows->integer(0);
      for (const auto& [topic, index] : d.parts[d.part].topics) {
        if (topic == id) out.topic = index;
      }
      out.stamp_ns = d.rows->integer(1);
      out.cdr = d.rows->bytes(2);
      return true;
    }
    if (++d.part == d.parts.size()) break;
    if (auto begun = d.begin(); !begun) return begun.error();
  }
  return false;
}

}  // namespace adit::dataset
