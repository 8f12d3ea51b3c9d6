// A word of a scenario or world file that stands for the member of an enumeration.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "components/config/yaml_reader.hpp"

namespace adit::tunnel_simulator {

// The position among `words` of the text under `key`; `otherwise` when it is absent or, with an error, none of them.
inline std::size_t choice(const YamlSection& section, const std::string& key, std::size_t otherwise,
                          const std::vector<std::string>& words) {
  if (!section.has(key)) return otherwise;
  const std::string word = section.text(key, "");
  const auto found = std::find(words.begin(), words.end(), word);
  if (found != words.end()) return static_cast<std::size_t>(found - words.begin());
  std::string list;
  for (const std::string& known : words) list += (list.empty() ? "" : ", ") + known;
  section.error(key, "'" + key + "': expected one of " + list + ", not '" + word + "'");
  return otherwise;
}

}  // namespace adit::tunnel_simulator
