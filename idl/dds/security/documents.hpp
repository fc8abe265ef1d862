#pragma once

#include <optional>
#include <string>

#include "idl/dds/security/access.hpp"
#include "idl/dds/security/certificate.hpp"

namespace stillmap::dds {

/// The rules of the domain, for all domain ids: nobody without a valid identity takes part, and
/// discovery, liveliness and data are encrypted.
[[nodiscard]] std::string governance_text();

/// What one identity may do.
struct Permissions {
  /// Its certificate's subject, in RFC 2253's order.
  std::string subject;
  Validity validity;
  Access access;
};

[[nodiscard]] std::string to_text(const Permissions& permissions);

/// Of a document with one grant, as to_text() makes it; nothing when it is another kind of text.
[[nodiscard]] std::optional<Permissions> permissions_from_text(const std::string& text);

}  // namespace stillmap::dds
