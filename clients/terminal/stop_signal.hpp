#pragma once

#include <chrono>

namespace stillmap::cli {

/// Turns SIGINT, SIGTERM and SIGHUP into something to ask for, so that a run can end in order and
/// keep what it has. Make it before any thread starts: threads inherit the blocked signals.
class StopSignal {
 public:
  /// Throws std::system_error.
  StopSignal();
  ~StopSignal();
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;

  /// Waits up to `timeout` for the signal; true once it came.
  [[nodiscard]] bool wait_for(std::chrono::milliseconds timeout);
  [[nodiscard]] bool requested() { return wait_for(std::chrono::milliseconds(0)); }

 private:
  int signal_fd_ = -1;
};

/// Lets these signals end the process as ever, but not before its temporary folders
/// (TemporaryFolder) are removed. For commands that cannot end their run in order; to be called
/// before any thread starts, and not along with a StopSignal.
void end_cleanly_when_stopped();

}  // namespace stillmap::cli
