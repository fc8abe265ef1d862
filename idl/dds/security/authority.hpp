#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "idl/dds/security/certificate.hpp"
#include "idl/dds/security/documents.hpp"

namespace stillmap::dds {

/// The folder of a certificate authority and of the identities that it made: `authority/` with its
/// key, and a folder for each identity that holds all that this identity needs elsewhere.
class Authority {
 public:
  /// Makes the folder. Throws SecurityError when it has an authority already, or cannot be written.
  [[nodiscard]] static Authority make(const std::filesystem::path& folder, int days);
  /// Throws SecurityError when there is none.
  [[nodiscard]] static Authority open(const std::filesystem::path& folder);

  /// Makes an identity, or with `replace` a new one in its place; returns its folder. Throws
  /// SecurityError for a name that cannot be a folder or exists; one that cannot be written leaves
  /// all as it was.
  std::filesystem::path add(const std::string& name, const std::string& role, const Access& access,
                            const Validity& validity, bool replace = false) const;

  /// Folders of the identities, by name.
  [[nodiscard]] std::vector<std::filesystem::path> identities() const;
  [[nodiscard]] std::filesystem::path key_file() const;
  [[nodiscard]] const Certificate& certificate() const { return certificate_; }

 private:
  Authority(std::filesystem::path folder, Certificate certificate, PrivateKey key);

  std::filesystem::path folder_;
  Certificate certificate_;
  PrivateKey key_;
};

}  // namespace stillmap::dds
