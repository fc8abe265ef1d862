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

/// stillmap-server in a process of its own, until the object goes out of scope.
class ServerProcess {
 public:
  /// Starts it with these arguments; its log goes to `log_file`.
  ServerProcess(const std::string& arguments, const std::filesystem::path& log_file);
  ~ServerProcess();
  ServerProcess(const ServerProcess&) = delete;
  ServerProcess& operator=(const ServerProcess&) = delete;

  /// SIGTERM; returns its exit code.
  int stop();

 private:
  int pid_ = -1;
};

/// A DDS domain that no process on this machine uses.
[[nodiscard]] int free_domain();

}  // namespace stillmap::test
