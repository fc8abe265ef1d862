#pragma once

#include <signal.h>

#include <functional>

namespace stillmap::server {

/// What the process gets when one of its threads fails: whoever waits for it ends the server in
/// order, and saves what can be saved. Where nobody does, it ends the process.
inline constexpr int thread_failure_signal = SIGUSR1;

/// Blocks the signal, which stays pending for sigwait, and adds it to `signals`. To be called
/// before the program starts threads, as block_stop_signals.
void block_thread_failures(sigset_t& signals);

/// Does the work of a thread. What it throws is logged as the reason why the server ends, and the
/// process gets thread_failure_signal; the thread is then over, but for `on_failure`.
void run_or_report(const std::function<void()>& work,
                   const std::function<void()>& on_failure = {}) noexcept;

}  // namespace stillmap::server
