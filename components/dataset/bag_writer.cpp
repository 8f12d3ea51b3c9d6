#include "components/dataset/bag_writer.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <optional>
#include <sstream>
#include <vector>

#include "components/dataset/sqlite_file.hpp"

namespace adit::dataset {
namespace {

constexpr const char* kDistribution = "jazzy";
constexpr std::uint64_t kBytesEvery = 64ULL << 20;  // in one transaction
constexpr std::uint64_t kSamplesEvery = 512;

const char* const kTables =
    "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY,ros_distro TEXT NOT NULL);"
    "CREATE TABLE metadata(id INTEGER PRIMARY KEY,metadata_version INTEGER NOT NULL,metadata TEXT NOT NULL);"
    "CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL,serialization_format TEXT NOT "
    "NULL,offered_qos_profiles TEXT NOT NULL,type_description_hash TEXT NOT NULL);"
    "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY,topic_type TEXT NOT NULL,encoding TEXT NOT "
    "NULL,encoded_message_definition TEXT NOT NULL,type_description_hash TEXT NOT NULL);"
    "CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,timestamp INTEGER NOT NULL, data BLOB NOT "
    "NULL);"
    "CREATE INDEX timestamp_idx ON messages (timestamp ASC);";

// A YAML double-quoted scalar.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    if (c == '\n') {
      out += "\\n";
    } else {
      out += c;
    }
  }
  return out + '"';
}

std::string indented(const std::string& text) {
  std::string out;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) out += "  " + line + "\n";
  return out;
}

}  // namespace

struct BagWriter::Impl {
  std::string folder, file_name;
  SqliteFile file;
  std::optional<SqliteStatement> insert;
  std::vector<BagTopic> topics;
  std::vector<std::uint64_t> counts;
  std::uint64_t pending_bytes = 0, pending_samples = 0, total = 0;
  std::int64_t first = std::numeric_limits<std::int64_t>::max();
  std::int64_t last = std::numeric_limits<std::int64_t>::min();
  Safety safety = Safety::on_close;
  bool closed = false;

  Impl(std::string to_folder, std::string name, SqliteFile to_file)
      : folder(std::move(to_folder)), file_name(std::move(name)), file(std::move(to_file)) {}

  std::string metadata() const {
    const std::int64_t start = total > 0 ? first : 0;
    const std::int64_t duration = total > 0 ? last - first : 0;
    std::ostringstream out;
    out << "version: 8\nstorage_identifier: sqlite3\nduration:\n  nanoseconds: " << duration
        << "\nstarting_time:\n  nanoseconds_since_epoch: " << start << "\nmessage_count: " << total
        << "\ntopics_with_message_count:\n";
    for (std::size_t i = 0; i < topics.size(); ++i) {
      const BagTopic& t = topics[i];
      out << "  - topic_metadata:\n      name: " << t.name << "\n      type: " << t.type
          << "\n      serialization_format: cdr\n      offered_qos_profiles: " << quoted(t.qos)
          << "\n      type_description_hash: " << quoted(t.type_hash) << "\n    message_count: " << counts[i] << '\n';
    }
    out << "compression_format: \"\"\ncompression_mode: \"\"\nrelative_file_paths:\n  - " << file_name
        << "\nfiles:\n  - path: " << file_name << "\n    starting_time:\n      nanoseconds_since_epoch: " << start
        << "\n    duration:\n      nanoseconds: " << duration << "\n    message_count: " << total
        << "\ncustom_data: ~\nros_distro: " << kDistribution << '\n';
    return out.str();
  }

  // A row whose last column is `text`, after an integer.
  Result<void> add_row(const std::string& sql, std::int64_t number, const std::string& text) {
    auto row = file.prepare(sql);
    if (!row) return row.error();
    row->bind(0, number);
    row->bind(1, std::string_view(text));
    const auto done = row->step();
    return done ? Result<void>() : done.error();
  }
};

BagWriter::BagWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

BagWriter::~BagWriter() {
  (void)close();
}

Result<std::unique_ptr<BagWriter>> BagWriter::create(const std::string& folder, Safety safety) {
  const std::filesystem::path path = std::filesystem::absolute(folder).lexically_normal();
  const std::string name = (path.has_filename() ? path : path.parent_path()).filename().string();
  std::error_code failed;
  std::filesystem::create_directories(path, failed);
  if (failed) return Error{ErrorCode::io, folder + ": " + failed.message()};
  std::filesystem::remove(path / "metadata.yaml", failed);
  const std::string file_name = name + "_0.db3";
  auto file = SqliteFile::create((path / file_name).string());
  if (!file) return file.error();
  std::unique_ptr<BagWriter> writer(new BagWriter(std::make_unique<Impl>(path.string(), file_name, *std::move(file))));
  Impl& d = *writer->impl_;
  d.safety = safety;
  // A write-ahead log that waits for the disk at each commit: only so does what was committed outlive a power cut.
  // Otherwise nothing is at stake before close().
  const std::string mode = safety == Safety::each_commit ? "PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL;"
                                                         : "PRAGMA synchronous = OFF;";
  if (auto made = d.file.execute(mode + " BEGIN;" + kTables); !made) return made.error();
  if (auto row = d.add_row("INSERT INTO schema VALUES (?, ?)", 4, kDistribution); !row) return row.error();
  auto insert = d.file.prepare("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)");
  if (!insert) return insert.error();
  d.insert = *std::move(insert);
  return writer;
}

Result<std::size_t> BagWriter::add_topic(const BagTopic& topic) {
  Impl& d = *impl_;
  const auto known =
      std::find_if(d.topics.begin(), d.topics.end(), [&](const auto& t) { return t.name == topic.name; });
  if (known != d.topics.end()) {
    if (known->type == topic.type) return static_cast<std::size_t>(known - d.topics.begin());
    return Error{ErrorCode::invalid_argument,
                 topic.name + " is in the bag with type " + known->type + ", not " + topic.type};
  }
  auto row = d.file.prepare(
      "INSERT INTO topics (name, type, serialization_format, offered_qos_profiles, type_description_hash) "
      "VALUES (?, ?, 'cdr', ?, ?)");
  if (!row) return row.error();
  const std::string* columns[] = {&topic.name, &topic.type, &topic.qos, &topic.type_hash};
  for (int i = 0; i < 4; ++i) row->bind(i, std::string_view(*columns[i]));
  if (auto done = row->step(); !done) return done.error();
  const bool defined =
      std::any_of(d.topics.begin(), d.topics.end(), [&](const auto& t) { return t.type == topic.type; });
  if (!defined && !topic.schema.empty()) {
    auto definition = d.file.prepare(
        "INSERT INTO message_definitions (topic_type, encoding, encoded_message_definition, type_description_hash) "
        "VALUES (?, 'ros2msg', ?, ?)");
    if (!definition) return definition.error();
    definition->bind(0, std::string_view(topic.type));
    definition->bind(1, std::string_view(topic.schema));
    definition->bind(2, std::string_view(topic.type_hash));
    if (auto done = definition->step(); !done) return done.error();
  }
  d.topics.push_back(topic);
  d.counts.push_back(0);
  return d.topics.size() - 1;
}

Result<void> BagWriter::write(const BagSample& sample) {
  Impl& d = *impl_;
  if (d.closed || sample.topic >= d.topics.size()) {
    return Error{ErrorCode::invalid_argument, d.folder + ": the bag is closed or has no such topic"};
  }
  d.insert->bind(0, static_cast<std::int64_t>(sample.topic) + 1);
  d.insert->bind(1, sample.stamp_ns);
  d.insert->bind(2, sample.cdr);
  if (auto done = d.insert->step(); !done) return done.error();
  ++d.counts[sample.topic];
  ++d.total;
  d.first = std::min(d.first, sample.stamp_ns);
  d.last = std::max(d.last, sample.stamp_ns);
  d.pending_bytes += sample.cdr.size();
  if (++d.pending_samples < kSamplesEvery && d.pending_bytes < kBytesEvery) return {};
  return commit();
}

Result<void> BagWriter::commit() {
  Impl& d = *impl_;
  if (d.closed) return {};
  d.pending_bytes = d.pending_samples = 0;
  return d.file.execute("COMMIT; BEGIN");
}

Result<void> BagWriter::close() {
  Impl& d = *impl_;
  if (d.closed) return {};
  d.closed = true;
  const std::string text = d.metadata();
  d.insert.reset();
  if (auto row = d.add_row("INSERT INTO metadata (metadata_version, metadata) VALUES (?, ?)", 8, text); !row)
    return row;
  // Leaving the log's mode merges it: the bag is one file again, as a reader without write access needs it.
  const char* end = d.safety == Safety::each_commit ? "COMMIT; PRAGMA journal_mode = DELETE" : "COMMIT";
  if (auto committed = d.file.execute(end); !committed) return committed;
  const std::string path = d.folder + "/metadata.yaml";
  std::ofstream out(path, std::ios::trunc);
  out << "rosbag2_bagfile_information:\n" << indented(text);
  out.flush();
  if (!out) return Error{ErrorCode::io, path + ": cannot be written"};
  return {};
}

}  // namespace adit::dataset
