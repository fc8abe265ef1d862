#pragma once

namespace stillmap::server {

/// Gives the calling thread only the time that no other thread wants: on busy cores the mapper and
/// its network come first, whatever is done in the background. False where the system refuses.
bool use_idle_scheduling();

}  // namespace stillmap::server
