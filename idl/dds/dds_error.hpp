#pragma once

#include <stdexcept>

namespace stillmap::dds {

/// DDS set-up that cannot work: the text names the domain, topic or setting and what to check.
class DdsError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace stillmap::dds
