#pragma once

#include <functional>

namespace stillmap {

/// Called again and again during long work, from every thread that works, where it may be held up
/// for a moment. Empty: nobody holds it up.
using Pause = std::function<void()>;

}  // namespace stillmap
