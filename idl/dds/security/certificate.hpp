#pragma once

#include <openssl/evp.h>
#include <openssl/x509.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

#include "idl/dds/dds_error.hpp"

namespace stillmap::dds {

/// A span of wall clock time, to the second.
struct Validity {
  std::chrono::sys_seconds from;
  std::chrono::sys_seconds to;

  [[nodiscard]] bool contains(std::chrono::sys_seconds time) const {
    return from <= time && time <= to;
  }
  /// From yesterday, so that a clock that is behind does not refuse a new certificate, for `days`.
  [[nodiscard]] static Validity days_from_now(int days);
};

/// "2026-11-21 14:30:00 UTC".
[[nodiscard]] std::string to_text(std::chrono::sys_seconds time);

/// A private key of the curve P-256.
class PrivateKey {
 public:
  [[nodiscard]] static PrivateKey make();
  /// Throws SecurityError naming the file.
  [[nodiscard]] static PrivateKey read(const std::filesystem::path& file);
  /// Readable for the owner only. Throws SecurityError.
  void write(const std::filesystem::path& file) const;

  [[nodiscard]] EVP_PKEY* get() const { return key_.get(); }

 private:
  explicit PrivateKey(EVP_PKEY* key) : key_(key, EVP_PKEY_free) {}
  std::shared_ptr<EVP_PKEY> key_;
};

/// An X.509 certificate. Subjects of ours are CN (name), OU (role) and O (Stillmap).
class Certificate {
 public:
  /// Signs itself, and may sign others.
  [[nodiscard]] static Certificate make_authority(const PrivateKey& key, const std::string& name,
                                                  const Validity& validity);
  /// Signed by `authority`, whose key is `authority_key`.
  [[nodiscard]] static Certificate issue(const PrivateKey& key, const std::string& name,
                                         const std::string& role, const Validity& validity,
                                         const Certificate& authority,
                                         const PrivateKey& authority_key);
  /// Throws SecurityError naming the file.
  [[nodiscard]] static Certificate read(const std::filesystem::path& file);
  void write(const std::filesystem::path& file) const;

  /// As RFC 2253 writes it, which is how permissions name it: CN first.
  [[nodiscard]] std::string subject() const;
  /// Empty when the subject has none.
  [[nodiscard]] std::string name() const;
  [[nodiscard]] std::string role() const;
  [[nodiscard]] Validity validity() const;
  [[nodiscard]] bool is_signed_by(const Certificate& authority) const;
  [[nodiscard]] bool belongs_to(const PrivateKey& key) const;

  [[nodiscard]] X509* get() const { return certificate_.get(); }

 private:
  explicit Certificate(X509* certificate) : certificate_(certificate, X509_free) {}
  [[nodiscard]] std::string part_of_subject(int nid) const;
  std::shared_ptr<X509> certificate_;
};

/// What OpenSSL says about the last failure of this thread.
[[nodiscard]] std::string openssl_reason();

}  // namespace stillmap::dds
