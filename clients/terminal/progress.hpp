#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace stillmap::cli {

/// How far a long run is, on stderr: a bar that is redrawn where stderr is a terminal, else a
/// plain line every few seconds. One thread uses it.
class Progress {
 public:
  /// `what` is the unit counted: "scans". A `total` of 0 means that the end is not known.
  Progress(std::string task, std::string what, std::uint64_t total);
  /// Ends the bar's line, so that what is printed next starts on its own.
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// `note` stands behind the figures ("2 skipped").
  void update(std::uint64_t done, const std::string& note = {});
  /// Prints a line of its own between two drawings of the bar.
  void say(const std::string& line);

 private:
  using Clock = std::chrono::steady_clock;

  [[nodiscard]] std::string figures(std::uint64_t done, Clock::time_point now) const;
  void clear_bar();

  std::string task_;
  std::string what_;
  std::uint64_t total_;
  bool terminal_;
  bool bar_shown_ = false;
  Clock::time_point started_;
  Clock::time_point drawn_;
};

}  // namespace stillmap::cli
