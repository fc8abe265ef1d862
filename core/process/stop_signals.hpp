#pragma once

#include <signal.h>

namespace stillmap {

/// Blocks SIGINT, SIGTERM, and SIGHUP unless it is ignored (nohup), which stay pending for sigwait
/// or a signalfd, and returns them. To be called before the program starts threads: they inherit
/// it. Threads that libraries started when they were loaded, as OpenBLAS does, do not: where one of
/// them gets the signal, it blocks it, too, and hands it back to the process.
[[nodiscard]] sigset_t block_stop_signals();

}  // namespace stillmap
