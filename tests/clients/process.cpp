#include "tests/clients/process.hpp"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <vector>

#include "tests/domain_lease.hpp"

namespace stillmap::test {
namespace {

std::string content(const std::filesystem::path& file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), {}};
}

int exit_code_of(int wait_status) { return WIFEXITED(wait_status) ? WEXITSTATUS(wait_status) : -1; }

}  // namespace

std::string stillmap_program() { return STILLMAP_PROGRAM; }

std::string stillmap_server_program() { return STILLMAP_SERVER_PROGRAM; }

ProcessResult run_stillmap(const std::string& arguments, const std::filesystem::path& folder) {
  const std::filesystem::path out = folder / "stdout.txt";
  const std::filesystem::path err = folder / "stderr.txt";
  const std::string command = stillmap_program() + " " + arguments + " >" + out.string() + " 2>" +
                              err.string() + " </dev/null";
  const int wait_status = std::system(command.c_str());
  return {exit_code_of(wait_status), content(out), content(err)};
}

BackgroundProcess::BackgroundProcess(const std::string& command,
                                     const std::filesystem::path& log_file) {
  std::string shell = "sh", option = "-c";
  std::string text = "exec " + command + " >" + log_file.string() + " 2>&1";
  std::vector<char*> argv{shell.data(), option.data(), text.data(), nullptr};
  if (posix_spawnp(&pid_, "sh", nullptr, nullptr, argv.data(), environ) != 0) {
    throw std::runtime_error("cannot start " + command);
  }
}

BackgroundProcess::~BackgroundProcess() {
  if (pid_ > 0) {
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
}

void BackgroundProcess::send(int signal) const { kill(pid_, signal); }

bool BackgroundProcess::has_ended() const {
  siginfo_t ended{};
  return waitid(P_PID, static_cast<id_t>(pid_), &ended, WEXITED | WNOHANG | WNOWAIT) == 0 &&
         ended.si_pid == pid_;
}

int BackgroundProcess::stop() {
  send(SIGTERM);
  return wait();
}

int BackgroundProcess::wait() {
  int wait_status = 0;
  waitpid(pid_, &wait_status, 0);
  pid_ = -1;
  return exit_code_of(wait_status);
}

int free_domain() {
  // As long as the process that asked runs.
  static std::vector<DomainLease> leases;
  return leases.emplace_back(DomainLease::take()).domain();
}

}  // namespace stillmap::test
