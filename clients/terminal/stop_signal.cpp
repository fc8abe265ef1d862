#include "clients/terminal/stop_signal.hpp"

#include <poll.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <limits>
#include <system_error>
#include <thread>

#include "core/process/stop_signals.hpp"
#include "core/process/temporary_folder.hpp"

namespace stillmap::cli {

StopSignal::StopSignal() {
  const sigset_t signals = block_stop_signals();
  signal_fd_ = signalfd(-1, &signals, SFD_CLOEXEC | SFD_NONBLOCK);
  if (signal_fd_ < 0) throw std::system_error(errno, std::generic_category(), "signalfd");
}

StopSignal::~StopSignal() { close(signal_fd_); }

bool StopSignal::wait_for(std::chrono::milliseconds timeout) {
  // The signal is never read, so it stays pending and every later question gets the same answer.
  pollfd waiting{.fd = signal_fd_, .events = POLLIN, .revents = 0};
  constexpr std::chrono::milliseconds::rep max_ms = std::numeric_limits<int>::max();
  return poll(&waiting, 1, static_cast<int>(std::min(timeout.count(), max_ms))) > 0;
}

void end_cleanly_when_stopped() {
  const sigset_t signals = block_stop_signals();
  std::thread([signals] {
    int signal = 0;
    if (sigwait(&signals, &signal) != 0) return;
    TemporaryFolder::remove_all_at_end();
    static_cast<void>(std::signal(signal, SIG_DFL));
    pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
    raise(signal);
  }).detach();
}

}  // namespace stillmap::cli
