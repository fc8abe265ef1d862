#pragma once

#include <optional>
#include <string>

#include "idl/dds/security/certificate.hpp"

namespace stillmap::dds {

/// The text with its signature, as S/MIME: the form in which DDS Security wants governance and
/// permissions. Throws SecurityError.
[[nodiscard]] std::string sign_document(const std::string& text, const Certificate& authority,
                                        const PrivateKey& authority_key);

/// The text of a signed document; nothing when it was not signed by this authority, or is damaged.
[[nodiscard]] std::optional<std::string> verified_text(const std::string& document,
                                                       const Certificate& authority);

}  // namespace stillmap::dds
