// A parameter value as it comes from a deployment file: a small tree that knows where it was written.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace adit {

struct Value {
  using List = std::vector<Value>;
  using Map = std::vector<std::pair<std::string, Value>>;

  std::variant<std::monostate, bool, std::int64_t, double, std::string, List, Map> content;
  std::string where;  // "deployments/tunnel.yaml:14"; starts the error message; may be empty

  Value() = default;
  Value(bool value) : content(value) {}                      // NOLINT: implicit by intent, as the next ones
  Value(int value) : content(std::int64_t{value}) {}         // NOLINT
  Value(std::int64_t value) : content(value) {}              // NOLINT
  Value(double value) : content(value) {}                    // NOLINT
  Value(const char* value) : content(std::string(value)) {}  // NOLINT
  Value(std::string value) : content(std::move(value)) {}    // NOLINT
  Value(List value) : content(std::move(value)) {}           // NOLINT
  Value(Map value) : content(std::move(value)) {}            // NOLINT
};

// "text", 3, 2.5, true, [1, 2], {a: 1}
std::string to_string(const Value& value);
// "a string", "an integer", ... : for messages
std::string kind_of(const Value& value);

}  // namespace adit
