#pragma once

#include <stdexcept>
#include <string>

namespace stillmap {

/// A part of Stillmap that is not installed, or cannot be loaded. The text says what needs it and
/// which package brings it.
class MissingPlugin : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Address of a function in stillmap_<part>.so, which is loaded at the first call and stays: a
/// reader or writer whose libraries are large and rarely needed. `purpose` goes before "by" in the
/// error: "PCD files are read". Looks beside this program's installation or build, then where the
/// dynamic linker looks. Throws MissingPlugin. Thread-safe.
[[nodiscard]] void* plugin_symbol(const std::string& part, const std::string& function,
                                  const std::string& purpose);

/// The same as a pointer to a function of this type, which must be the one it was compiled with.
template <typename Function>
[[nodiscard]] Function* plugin_function(const std::string& part, const std::string& function,
                                        const std::string& purpose) {
  return reinterpret_cast<Function*>(plugin_symbol(part, function, purpose));
}

}  // namespace stillmap
