#pragma once

#include <string>

namespace stillmap {

/// Tells systemd, when it started us with Type=notify: "READY=1", "STOPPING=1" (sd_notify(3)).
/// Elsewhere nothing happens.
void tell_service_manager(const std::string& state);

}  // namespace stillmap
