#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace stillmap::cli {

/// A number with this many decimals.
[[nodiscard]] std::string fixed(double value, int decimals);

/// Rows in columns: the first column to the left, all others to the right. The first row is the
/// head, with a line under it.
class Table {
 public:
  explicit Table(std::vector<std::string> head);
  /// Missing cells stay empty.
  void add(std::vector<std::string> row);
  [[nodiscard]] std::string text() const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace stillmap::cli
