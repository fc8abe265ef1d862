#include "core/process/stop_signals.hpp"

#include <ucontext.h>
#include <unistd.h>

namespace stillmap {
namespace {

bool is_ignored(int signal) {
  struct sigaction action {};
  return sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

/// A terminal that is closed sends SIGHUP; under nohup, programs go on.
sigset_t stop_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  if (!is_ignored(SIGHUP)) sigaddset(&signals, SIGHUP);
  return signals;
}

/// Async-signal-safe. The mask takes effect in the interrupted thread when the handler returns.
void hand_back(int signal, siginfo_t* /*info*/, void* context) {
  sigset_t& mask = static_cast<ucontext_t*>(context)->uc_sigmask;
  for (const int stop : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&mask, stop);
  kill(getpid(), signal);
}

}  // namespace

sigset_t block_stop_signals() {
  const sigset_t signals = stop_signals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  struct sigaction action {};
  action.sa_sigaction = hand_back;
  action.sa_flags = SA_SIGINFO | SA_RESTART;
  action.sa_mask = signals;
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    if (sigismember(&signals, signal) == 1) sigaction(signal, &action, nullptr);
  }
  return signals;
}

}  // namespace stillmap
