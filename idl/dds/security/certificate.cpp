#include "idl/dds/security/certificate.hpp"

#include <fcntl.h>
#include <openssl/ec.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509v3.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>

namespace stillmap::dds {
namespace {

namespace fs = std::filesystem;
using std::chrono::sys_seconds;

using OpenFile = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

// The characters of other languages stay as they are; Fast DDS compares the same form.
constexpr unsigned long subject_form = XN_FLAG_RFC2253 & ~ASN1_STRFLGS_ESC_MSB;

void require(bool worked, const std::string& what) {
  if (!worked) throw SecurityError("cannot " + what + ": " + openssl_reason());
}

OpenFile open_to_read(const fs::path& file) {
  OpenFile opened(std::fopen(file.c_str(), "r"), std::fclose);
  if (!opened) {
    const std::string reason = std::strerror(errno);
    throw SecurityError(file.string() + " cannot be read: " + reason);
  }
  return opened;
}

OpenFile open_to_write(const fs::path& file, mode_t mode) {
  // A key must not be readable by others even for a moment, nor written into somebody's file.
  ::unlink(file.c_str());
  const int descriptor = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL, mode);
  if (descriptor < 0) {
    const std::string reason = std::strerror(errno);
    throw SecurityError(file.string() + " cannot be written: " + reason);
  }
  return {::fdopen(descriptor, "w"), std::fclose};
}

// What is written lies in memory until then: a full disk shows here first.
void close_written(OpenFile opened, const fs::path& file) {
  if (std::fclose(opened.release()) == 0) return;
  const std::string reason = std::strerror(errno);
  throw SecurityError(file.string() + " cannot be written: " + reason);
}

std::string text_of(const X509_NAME* name) {
  const std::unique_ptr<BIO, void (*)(BIO*)> memory(BIO_new(BIO_s_mem()), BIO_free_all);
  X509_NAME_print_ex(memory.get(), name, 0, subject_form);
  char* text = nullptr;
  const long length = BIO_get_mem_data(memory.get(), &text);
  return {text, static_cast<std::size_t>(length)};
}

void add_to_name(X509_NAME& name, const char* field, const std::string& value) {
  const auto* bytes = reinterpret_cast<const unsigned char*>(value.data());
  require(X509_NAME_add_entry_by_txt(&name, field, MBSTRING_UTF8, bytes,
                                     static_cast<int>(value.size()), -1, 0) == 1,
          "name a certificate '" + value + "'");
}

void add_extension(X509& certificate, int nid, const char* value) {
  const std::unique_ptr<X509_EXTENSION, void (*)(X509_EXTENSION*)> extension(
      X509V3_EXT_conf_nid(nullptr, nullptr, nid, value), X509_EXTENSION_free);
  require(extension && X509_add_ext(&certificate, extension.get(), -1) == 1,
          "add an extension to a certificate");
}

sys_seconds to_time(const ASN1_TIME& time) {
  std::tm parts{};
  require(ASN1_TIME_to_tm(&time, &parts) == 1, "read the time in a certificate");
  return sys_seconds(std::chrono::seconds(::timegm(&parts)));
}

// Everything but names, extensions and signature.
X509* begin_certificate(const PrivateKey& key, const Validity& validity) {
  X509* const certificate = X509_new();
  std::uint64_t serial = 0;
  require(certificate != nullptr &&
              RAND_bytes(reinterpret_cast<unsigned char*>(&serial), sizeof serial) == 1,
          "make a certificate");
  X509_set_version(certificate, X509_VERSION_3);
  ASN1_INTEGER_set_uint64(X509_get_serialNumber(certificate), serial >> 1);
  ASN1_TIME_set(X509_getm_notBefore(certificate), validity.from.time_since_epoch().count());
  ASN1_TIME_set(X509_getm_notAfter(certificate), validity.to.time_since_epoch().count());
  X509_set_pubkey(certificate, key.get());
  return certificate;
}

}  // namespace

std::string openssl_reason() {
  std::array<char, 256> text{};
  const unsigned long code = ERR_peek_last_error();
  ERR_clear_error();
  if (code == 0) return "no reason given";
  ERR_error_string_n(code, text.data(), text.size());
  return text.data();
}

Validity Validity::days_from_now(int days) {
  const auto now = std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now());
  return {.from = now - std::chrono::days(1), .to = now + std::chrono::days(days)};
}

std::string to_text(sys_seconds time) {
  const std::time_t seconds = time.time_since_epoch().count();
  std::tm parts{};
  ::gmtime_r(&seconds, &parts);
  std::array<char, 64> text{};
  const std::size_t length =
      std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M:%S UTC", &parts);
  return {text.data(), length};
}

PrivateKey PrivateKey::make() {
  EVP_PKEY* const key = EVP_EC_gen("P-256");
  require(key != nullptr, "make a key");
  return PrivateKey(key);
}

PrivateKey PrivateKey::read(const fs::path& file) {
  const OpenFile opened = open_to_read(file);
  EVP_PKEY* const key = PEM_read_PrivateKey(opened.get(), nullptr, nullptr, nullptr);
  if (key == nullptr) {
    throw SecurityError(file.string() + " is no private key in PEM format: " + openssl_reason());
  }
  return PrivateKey(key);
}

void PrivateKey::write(const fs::path& file) const {
  OpenFile opened = open_to_write(file, S_IRUSR | S_IWUSR);
  require(PEM_write_PrivateKey(opened.get(), get(), nullptr, nullptr, 0, nullptr, nullptr) == 1,
          "write " + file.string());
  close_written(std::move(opened), file);
}

Certificate Certificate::make_authority(const PrivateKey& key, const std::string& name,
                                        const Validity& validity) {
  Certificate made(begin_certificate(key, validity));
  X509_NAME* const subject = X509_get_subject_name(made.get());
  add_to_name(*subject, "O", "Stillmap");
  add_to_name(*subject, "CN", name);
  X509_set_issuer_name(made.get(), subject);
  add_extension(*made.get(), NID_basic_constraints, "critical,CA:TRUE");
  add_extension(*made.get(), NID_key_usage, "critical,keyCertSign,cRLSign,digitalSignature");
  require(X509_sign(made.get(), key.get(), EVP_sha256()) > 0, "sign a certificate");
  return made;
}

Certificate Certificate::issue(const PrivateKey& key, const std::string& name,
                               const std::string& role, const Validity& validity,
                               const Certificate& authority, const PrivateKey& authority_key) {
  Certificate made(begin_certificate(key, validity));
  X509_NAME* const subject = X509_get_subject_name(made.get());
  add_to_name(*subject, "O", "Stillmap");
  add_to_name(*subject, "OU", role);
  add_to_name(*subject, "CN", name);
  X509_set_issuer_name(made.get(), X509_get_subject_name(authority.get()));
  require(X509_sign(made.get(), authority_key.get(), EVP_sha256()) > 0, "sign a certificate");
  return made;
}

Certificate Certificate::read(const fs::path& file) {
  const OpenFile opened = open_to_read(file);
  X509* const certificate = PEM_read_X509(opened.get(), nullptr, nullptr, nullptr);
  if (certificate == nullptr) {
    throw SecurityError(file.string() + " is no certificate in PEM format: " + openssl_reason());
  }
  return Certificate(certificate);
}

void Certificate::write(const fs::path& file) const {
  OpenFile opened = open_to_write(file, S_IRUSR | S_IWUSR | S_IRGRP | S_IROTH);
  require(PEM_write_X509(opened.get(), get()) == 1, "write " + file.string());
  close_written(std::move(opened), file);
}

std::string Certificate::subject() const { return text_of(X509_get_subject_name(get())); }
std::string Certificate::name() const { return part_of_subject(NID_commonName); }
std::string Certificate::role() const { return part_of_subject(NID_organizationalUnitName); }

std::string Certificate::part_of_subject(int nid) const {
  std::array<char, 256> text{};
  const int length = X509_NAME_get_text_by_NID(X509_get_subject_name(get()), nid, text.data(),
                                               static_cast<int>(text.size()));
  return length > 0 ? std::string(text.data(), static_cast<std::size_t>(length)) : std::string();
}

Validity Certificate::validity() const {
  return {.from = to_time(*X509_get0_notBefore(get())), .to = to_time(*X509_get0_notAfter(get()))};
}

bool Certificate::is_signed_by(const Certificate& authority) const {
  const bool is_signed = X509_verify(get(), X509_get0_pubkey(authority.get())) == 1;
  ERR_clear_error();
  return is_signed;
}

bool Certificate::belongs_to(const PrivateKey& key) const {
  const bool belongs = X509_check_private_key(get(), key.get()) == 1;
  ERR_clear_error();
  return belongs;
}

}  // namespace stillmap::dds
