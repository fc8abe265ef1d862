#pragma once

#include <functional>

namespace stillmap {

/// Called again and again during long work, from every thread that works, where it may be held up,
/// for a moment or until there is time for it. Empty: nobody holds it up.
using ThrottleCallback = std::function<void()>;

}  // namespace stillmap
