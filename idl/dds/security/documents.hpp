#pragma once

#include <optional>
#include <string>
#include <vector>

#include "idl/dds/security/certificate.hpp"

namespace stillmap::dds {

/// What an identity may do: DDS topic names ("rt/points"), in which * and ? stand for anything.
struct Access {
  std::vector<std::string> publish;
  std::vector<std::string> subscribe;

  [[nodiscard]] bool may_publish(const std::string& topic) const;
  [[nodiscard]] bool may_subscribe(const std::string& topic) const;
};

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
