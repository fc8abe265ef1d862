#pragma once

#include <functional>

namespace stillmap {

/// Called repeatedly during long work, by each thread that works. It may block to leave the
/// processor to others. Empty: no throttling.
using ThrottleCallback = std::function<void()>;

}  // namespace stillmap
