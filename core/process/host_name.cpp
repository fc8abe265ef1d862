#include "core/process/host_name.hpp"

#include <unistd.h>

#include <array>

namespace stillmap {

std::string host_name() {
  // The last byte stays zero: a name that is cut off may come without its end.
  std::array<char, 256> name{};
  ::gethostname(name.data(), name.size() - 1);
  return name.data();
}

}  // namespace stillmap
