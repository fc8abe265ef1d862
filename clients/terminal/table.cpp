#include "clients/terminal/table.hpp"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>
#include <utility>

namespace stillmap::cli {

std::string fixed(double value, int decimals) {
  // No decimals are known of larger numbers, and 1e300 has 301 digits.
  constexpr double largest_with_decimals = 1e15;
  std::ostringstream text;
  if (std::abs(value) < largest_with_decimals) text << std::fixed << std::setprecision(decimals);
  text << value;
  return text.str();
}

Table::Table(std::vector<std::string> head) { rows_.push_back(std::move(head)); }

void Table::add(std::vector<std::string> row) {
  row.resize(rows_.front().size());
  rows_.push_back(std::move(row));
}

std::string Table::text() const {
  std::vector<std::size_t> widths(rows_.front().size(), 0);
  for (const auto& row : rows_) {
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  std::ostringstream text;
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    std::size_t line_width = 0;
    for (std::size_t i = 0; i < widths.size(); ++i) {
      text << (i == 0 ? std::left : std::right) << std::setw(static_cast<int>(widths[i]))
           << rows_[r][i] << (i + 1 < widths.size() ? "  " : "\n");
      line_width += widths[i] + (i + 1 < widths.size() ? 2 : 0);
    }
    if (r == 0) text << std::string(line_width, '-') << "\n";
  }
  return text.str();
}

}  // namespace stillmap::cli
