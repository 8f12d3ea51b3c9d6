#include "middleware/ros/names.hpp"

#include <cctype>

namespace adit {

Result<void> validate_ros_name(std::string_view name) {
  const auto refuse = [&](const char* why) {
    return Error{ErrorCode::invalid_argument, "'" + std::string(name) + "' is not a ROS name: " + why};
  };
  if (name.empty() || name.front() != '/') return refuse("it must start with '/'");
  if (name.size() == 1 || name.back() == '/') return refuse("it must not end with '/'");
  if (name.size() > 248) return refuse("it is longer than 248 characters");
  for (std::size_t i = 1; i < name.size(); ++i) {
    const auto c = static_cast<unsigned char>(name[i]);
    const bool first_of_token = name[i - 1] == '/';
    if (c == '/' && first_of_token) return refuse("it has an empty part ('//')");
    if (first_of_token && std::isdigit(c)) return refuse("a part must not start with a digit");
    if (c != '/' && c != '_' && !std::isalnum(c)) return refuse("only letters, digits, '_' and '/' are allowed");
  }
  return {};
}

std::string to_dds_topic(std::string_view ros_topic) {
  return ros_topic.starts_with('/') ? "rt" + std::string(ros_topic) : std::string(ros_topic);
}

std::string from_dds_topic(std::string_view dds_topic) {
  return std::string(dds_topic.starts_with("rt/") ? dds_topic.substr(2) : dds_topic);
}

std::string from_dds_type(std::string_view dds_type) {
  constexpr std::string_view mark = "::dds_::";
  const std::size_t at = dds_type.find(mark);
  if (at == std::string_view::npos || !dds_type.ends_with('_')) return std::string(dds_type);
  std::string_view package = dds_type.substr(0, at);
  const std::string_view type = dds_type.substr(at + mark.size(), dds_type.size() - at - mark.size() - 1);
  std::string name;
  for (std::size_t colon = package.find("::"); colon != std::string_view::npos; colon = package.find("::")) {
    name.append(package.substr(0, colon)).append("/");
    package.remove_prefix(colon + 2);
  }
  return name.append(package).append("/").append(type);
}

NodeName split_node_name(std::string_view fully_qualified) {
  const std::size_t slash = fully_qualified.rfind('/');
  if (slash == std::string_view::npos) return {"/", std::string(fully_qualified)};
  return {slash == 0 ? "/" : std::string(fully_qualified.substr(0, slash)),
          std::string(fully_qualified.substr(slash + 1))};
}

std::string join_node_name(std::string_view node_namespace, std::string_view name) {
  std::string joined(node_namespace);
  if (!joined.ends_with('/')) joined += '/';
  return joined.append(name);
}

std::string_view user_data_value(std::string_view user_data, std::string_view key) {
  while (!user_data.empty()) {
    const std::size_t end = user_data.find(';');
    std::string_view entry = user_data.substr(0, end);
    const std::size_t equals = entry.find('=');
    if (equals != std::string_view::npos && entry.substr(0, equals) == key) return entry.substr(equals + 1);
    if (end == std::string_view::npos) break;
    user_data.remove_prefix(end + 1);
  }
  return {};
}

}  // namespace adit
