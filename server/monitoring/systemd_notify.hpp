#pragma once

#include <string>

namespace stillmap::server {

/// Tells systemd, when it started us with Type=notify: "READY=1", "STOPPING=1" (sd_notify(3)).
/// Elsewhere nothing happens.
void notify_systemd(const std::string& state);

}  // namespace stillmap::server
