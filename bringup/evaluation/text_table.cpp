#include "bringup/evaluation/text_table.hpp"

#include <algorithm>

namespace adit::evaluation {

std::string lay_out(const std::vector<TextRow>& rows) {
  std::vector<std::size_t> width(rows.front().size(), 0);
  for (const TextRow& row : rows) {
    for (std::size_t c = 0; c < row.size(); ++c) width[c] = std::max(width[c], row[c].size());
  }
  std::string out;
  for (std::size_t r = 0; r < rows.size(); ++r) {
    for (std::size_t c = 0; c < width.size(); ++c) {
      const std::string pad(width[c] - rows[r][c].size(), ' ');
      out += c == 0 ? rows[r][c] + pad : "  " + pad + rows[r][c];
    }
    while (out.back() == ' ') out.pop_back();
    out += '\n';
    if (r > 0) continue;
    for (std::size_t c = 0; c < width.size(); ++c) out += (c == 0 ? "" : "  ") + std::string(width[c], '-');
    out += '\n';
  }
  return out;
}

}  // namespace adit::evaluation
