#pragma once

namespace stillmap {

/// Asks for the memory at an address that will soon be read, so that it is there by then. Any
/// address may be asked for.
inline void prefetch([[maybe_unused]] const void* address) {
#ifdef __GNUC__
  __builtin_prefetch(address);
#endif
}

}  // namespace stillmap
