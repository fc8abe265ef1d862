#pragma once

#include "config/loaders/server_config.hpp"

namespace stillmap::server {

/// Sends log lines to stderr. Under systemd, whose journal has a clock of its own, a line is its
/// level as sd-daemon(3) marks it and its text; elsewhere time, level and text.
void start_log(LogLevel level);

/// Lines below this are left out from now on.
void set_log_level(LogLevel level);

/// Whether stderr goes to systemd's journal: JOURNAL_STREAM names it.
[[nodiscard]] bool stderr_is_journal();

}  // namespace stillmap::server
