#pragma once

#include <filesystem>
#include <string>

namespace stillmap::test {

/// What a program did.
struct ProcessResult {
  /// -1 when a signal ended it.
  int exit_code = -1;
  std::string out;
  std::string err;
};

/// Runs `stillmap ARGUMENTS` through the shell; stdout and stderr are no terminal. Uses
/// `folder` for their text.
[[nodiscard]] ProcessResult run_stillmap(const std::string& arguments,
                                         const std::filesystem::path& folder);

/// A program that runs beside the test, until the object goes out of scope.
class BackgroundProcess {
 public:
  /// Starts it; what it prints goes to `log_file`.
  BackgroundProcess(const std::string& command, const std::filesystem::path& log_file);
  ~BackgroundProcess();
  BackgroundProcess(const BackgroundProcess&) = delete;
  BackgroundProcess& operator=(const BackgroundProcess&) = delete;

  void send(int signal) const;
  /// It is wait()'s to tell how.
  [[nodiscard]] bool has_ended() const;
  /// Waits for its end; returns its exit code, -1 when a signal ended it.
  int wait();
  /// SIGTERM, and wait().
  int stop();

 private:
  int pid_ = -1;
};

/// Of the programs under test.
[[nodiscard]] std::string stillmap_program();
[[nodiscard]] std::string stillmap_server_program();

/// A DDS domain that no process on this machine uses.
[[nodiscard]] int free_domain();

}  // namespace stillmap::test
