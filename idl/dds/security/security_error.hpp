#pragma once

#include "idl/dds/dds_error.hpp"

namespace stillmap::dds {

/// Certificates, keys or permissions that cannot be used: the text names the file and the way out.
class SecurityError : public DdsError {
 public:
  using DdsError::DdsError;
};

/// The permissions of our own identity forbid it.
class NotPermitted : public SecurityError {
 public:
  using SecurityError::SecurityError;
};

}  // namespace stillmap::dds
