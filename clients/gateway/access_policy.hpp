#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace stillmap::gateway {

/// Who may talk to the gateway.
struct AccessOptions {
  /// Empty: none is asked for.
  std::string token;
  /// Only this machine reaches us, under its own names for itself.
  bool local_only = true;
  /// Hosts of other pages that may connect, beside ours and those of this machine.
  std::vector<std::string> origins;
};

/// What a request says of who sends it; empty where it does not.
struct RequestIdentity {
  std::string_view target;
  std::string_view host;
  std::string_view origin;
  std::string_view authorization;
  std::string_view cookie;
};

/// Judges requests by token, host and origin. A browser that has our page's address in its network
/// runs other people's pages, too: without a look at the origin any of these could read the map,
/// and without one at the host, one whose name was made to lead here (DNS rebinding).
class AccessPolicy {
 public:
  explicit AccessPolicy(AccessOptions options) : options_(std::move(options)) {}

  enum class Verdict { allowed, no_token, wrong_host, wrong_origin };
  [[nodiscard]] Verdict judge(const RequestIdentity& request) const;

  /// The value of a Set-Cookie that spares the page's next requests the token; nothing where the
  /// target does not have it.
  [[nodiscard]] std::optional<std::string> cookie_for(std::string_view target, bool over_tls) const;

 private:
  [[nodiscard]] bool has_token(const RequestIdentity& request) const;
  [[nodiscard]] bool is_token(std::string_view text) const;
  [[nodiscard]] bool allows_origin(const RequestIdentity& request) const;

  AccessOptions options_;
};

[[nodiscard]] std::string_view in_words(AccessPolicy::Verdict verdict);

/// The part of a request's target in front of "?".
[[nodiscard]] std::string_view path_of(std::string_view target);

/// Whether nobody but this machine reaches an address to listen on, as 127.0.0.1:8765.
[[nodiscard]] bool is_local_address(std::string_view address);

}  // namespace stillmap::gateway
