#include "server/threads/thread_failure.hpp"

#include <signal.h>
#include <spdlog/spdlog.h>
#include <ucontext.h>
#include <unistd.h>

#include <exception>

#include "server/threads/thread_name.hpp"

namespace stillmap::server {
namespace {

void report(const char* what) noexcept {
  // Of the log itself, nothing else is left to tell.
  try {
    spdlog::critical("thread {} failed, the server ends: {}", name_of_this_thread(), what);
  } catch (...) {
  }
  ::kill(::getpid(), thread_failure_signal);
}

/// For threads of libraries that do not block the signal. Async-signal-safe; the mask takes effect
/// in the interrupted thread when the handler returns.
void hand_back(int signal, siginfo_t* /*info*/, void* context) {
  sigaddset(&static_cast<ucontext_t*>(context)->uc_sigmask, signal);
  ::kill(::getpid(), signal);
}

}  // namespace

void block_thread_failures(sigset_t& signals) {
  sigaddset(&signals, thread_failure_signal);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  struct sigaction action {};
  action.sa_sigaction = hand_back;
  action.sa_flags = SA_SIGINFO | SA_RESTART;
  sigaction(thread_failure_signal, &action, nullptr);
}

void run_or_report(const std::function<void()>& work,
                   const std::function<void()>& on_failure) noexcept {
  try {
    work();
    return;
  } catch (const std::exception& error) {
    report(error.what());
  } catch (...) {
    report("something that is no std::exception");
  }
  if (!on_failure) return;
  try {
    on_failure();
  } catch (const std::exception& error) {
    report(error.what());
  }
}

}  // namespace stillmap::server
