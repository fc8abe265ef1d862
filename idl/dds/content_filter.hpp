#pragma once

#include <string>
#include <vector>

namespace stillmap::dds {

/// Which samples a reader wants, as DDS writes it: a condition in SQL's manner on the fields of the
/// topic's type, and the values of its parameters %0, %1 and so on. The type must be described
/// (type_support.hpp).
struct ContentFilter {
  std::string expression;
  std::vector<std::string> parameters;
};

}  // namespace stillmap::dds
