#pragma once

#include <functional>
#include <stdexcept>

namespace stillmap {

/// A search was to stop before it had any path; `what()` names the stage that it was in.
class PlanningStopped : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Throws PlanningStopped where `should_stop` says so, which may be empty.
inline void stop_in(const char* stage, const std::function<bool()>& should_stop) {
  if (should_stop && should_stop()) throw PlanningStopped(stage);
}

}  // namespace stillmap
