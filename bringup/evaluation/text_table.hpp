// Tables of text, for terminals and <pre>.
#pragma once

#include <string>
#include <vector>

namespace adit::evaluation {

using TextRow = std::vector<std::string>;

// The first row is the head, underlined; the first column is left aligned, the others right. Rows of equal length.
std::string lay_out(const std::vector<TextRow>& rows);

}  // namespace adit::evaluation
