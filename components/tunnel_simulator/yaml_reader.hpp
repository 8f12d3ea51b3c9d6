// Checked access to YAML: every value has a type, a range and a unit; every key must be known. The first mistake is
// kept as an Error that names file and line.
#pragma once

#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "idl/result.hpp"

namespace YAML {
class Node;
}

namespace adit::tunnel_simulator {

class YamlDocument;

// A mapping. Getters return the default when the key is absent or once anything is wrong.
class YamlMap {
 public:
  YamlMap(YamlDocument& document, const YAML::Node& node, std::string what);
  ~YamlMap();
  YamlMap(YamlMap&&) noexcept;

  bool has(const std::string& key) const;
  // A number with a unit that may be written out ("50 km/h", "36 deg"): km/h becomes m/s, deg rad, ms s, "%" a share.
  double number(const std::string& key, double fallback, double low, double high);
  int integer(const std::string& key, int fallback, int low, int high);
  bool boolean(const std::string& key, bool fallback);
  std::string text(const std::string& key, const std::string& fallback);
  // One of `choices`; its index.
  std::size_t choice(const std::string& key, std::size_t fallback, const std::vector<std::string>& choices);
  std::vector<double> numbers(const std::string& key, std::size_t count, double low, double high);
  std::vector<std::string> texts(const std::string& key);
  // Absent: an empty map.
  YamlMap map(const std::string& key);
  std::vector<YamlMap> maps(const std::string& key);
  // A getter's absence is an error.
  void require(const std::string& key);
  // Reports keys that no getter asked for.
  void finish();
  // Nothing wrong so far, in the whole document.
  bool ok() const;
  // Reports a mistake at this map, or at one of its keys.
  void fail(const std::string& message, const std::string& key = "");

 private:
  YAML::Node get(const std::string& key);
  YamlDocument* document_;
  std::unique_ptr<YAML::Node> node_;
  std::string what_;
  std::set<std::string> asked_;
};

class YamlDocument {
 public:
  // Reads the file; a syntax error is kept.
  explicit YamlDocument(std::string path);
  ~YamlDocument();
  YamlMap root(const std::string& what);
  bool ok() const { return !error_; }
  const Error& error() const { return *error_; }
  void fail(int line, const std::string& message, ErrorCode code = ErrorCode::malformed);
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  std::unique_ptr<YAML::Node> root_;
  std::optional<Error> error_;
};

}  // namespace adit::tunnel_simulator
