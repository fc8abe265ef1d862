#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <string>

#include "config/loaders/server_config.hpp"

namespace stillmap::server {

/// Sends log lines to stderr. Under systemd, whose journal records the time itself, a line is its
/// level as sd-daemon(3) marks it and its text; elsewhere time, level and text.
void start_log(LogLevel level);

/// Lines below this level are left out from now on.
void set_log_level(LogLevel level);

/// Logs a warning or an error of one kind at most every few seconds and says how many were left
/// out, so that a fault of every scan does not flood the log. One thread uses it.
class ThrottledLog {
 public:
  void warn(const std::string& kind, const std::string& text);
  void error(const std::string& kind, const std::string& text);

 private:
  /// What to log of it now; empty: nothing.
  [[nodiscard]] std::string due(const std::string& kind, const std::string& text);

  struct Kind {
    std::chrono::steady_clock::time_point last;
    std::uint64_t suppressed = 0;
  };
  std::map<std::string, Kind> kinds_;
};

/// The texts that were logged last, so that what lasts is logged once. One thread uses it.
class NewLines {
 public:
  /// Beyond them, the oldest is forgotten.
  static constexpr std::size_t max_lines = 1000;

  /// True when the text is not among them; then it is.
  bool add(const std::string& text);

 private:
  std::deque<std::string> lines_;
};

}  // namespace stillmap::server
