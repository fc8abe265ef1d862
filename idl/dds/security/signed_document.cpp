#include "idl/dds/security/signed_document.hpp"

#include <openssl/err.h>
#include <openssl/pkcs7.h>

#include <memory>

namespace stillmap::dds {
namespace {

using Bio = std::unique_ptr<BIO, void (*)(BIO*)>;
using Pkcs7 = std::unique_ptr<PKCS7, void (*)(PKCS7*)>;

Bio reading(const std::string& text) {
  return {BIO_new_mem_buf(text.data(), static_cast<int>(text.size())), BIO_free_all};
}

Bio memory() { return {BIO_new(BIO_s_mem()), BIO_free_all}; }

std::string content(BIO& bio) {
  char* text = nullptr;
  const long length = BIO_get_mem_data(&bio, &text);
  return length > 0 ? std::string(text, static_cast<std::size_t>(length)) : std::string();
}

}  // namespace

std::string sign_document(const std::string& text, const Certificate& authority,
                          const PrivateKey& authority_key) {
  constexpr int form = PKCS7_TEXT | PKCS7_DETACHED | PKCS7_STREAM;
  const Bio in = reading(text);
  const Bio out = memory();
  const Pkcs7 signature(PKCS7_sign(authority.get(), authority_key.get(), nullptr, in.get(), form),
                        PKCS7_free);
  if (!signature || SMIME_write_PKCS7(out.get(), signature.get(), in.get(), form) != 1) {
    throw SecurityError("cannot sign a document: " + openssl_reason());
  }
  return content(*out);
}

std::optional<std::string> verified_text(const std::string& document,
                                         const Certificate& authority) {
  const Bio in = reading(document);
  BIO* signed_part = nullptr;
  const Pkcs7 signature(SMIME_read_PKCS7(in.get(), &signed_part), PKCS7_free);
  const Bio owned(signed_part, BIO_free_all);
  const std::unique_ptr<STACK_OF(X509), void (*)(STACK_OF(X509)*)> signers(
      sk_X509_new_null(), [](STACK_OF(X509) * stack) { sk_X509_free(stack); });
  sk_X509_push(signers.get(), authority.get());
  const Bio out = memory();
  // Who signs is this authority and nobody else, so there is no chain to follow.
  const bool is_valid =
      signature && PKCS7_verify(signature.get(), signers.get(), nullptr, signed_part, out.get(),
                                PKCS7_TEXT | PKCS7_NOVERIFY | PKCS7_NOINTERN) == 1;
  ERR_clear_error();
  if (!is_valid) return std::nullopt;
  return content(*out);
}

}  // namespace stillmap::dds
