#pragma once

#include <functional>

namespace stillmap::gateway {

/// Hands work to the thread that has all clients, in order; from any thread, does not block.
using Post = std::function<void(std::function<void()>)>;

}  // namespace stillmap::gateway
