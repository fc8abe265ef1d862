#pragma once

#include <stdexcept>

namespace stillmap::dds {

/// DDS set-up that cannot work: the text names the domain, topic or setting and what to check.
class DdsError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Certificates, keys or permissions that cannot be used: the text names the file and what to do.
class SecurityError : public DdsError {
 public:
  using DdsError::DdsError;
};

/// The permissions of our identity forbid it.
class NotPermitted : public SecurityError {
 public:
  using SecurityError::SecurityError;
};

}  // namespace stillmap::dds
