#pragma once

#include <iostream>
#include <string>

namespace stillmap::peer {

/// One line of the peer's report: what it is about, then name=value pairs. People read it, and the
/// test does.
class Line {
 public:
  explicit Line(const std::string& subject) { std::cout << subject; }
  ~Line() { std::cout << std::endl; }
  Line(const Line&) = delete;
  Line& operator=(const Line&) = delete;

  template <typename Value>
  Line& add(const char* name, const Value& value) {
    std::cout << "  " << name << "=" << value;
    return *this;
  }
};

}  // namespace stillmap::peer
