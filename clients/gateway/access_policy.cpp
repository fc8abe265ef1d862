#include "clients/gateway/access_policy.hpp"

#include <arpa/inet.h>

#include <algorithm>
#include <array>

namespace stillmap::gateway {
namespace {

constexpr std::string_view token_key = "token=";
constexpr std::string_view cookie_key = "stillmap_token=";
/// Whose pages open connections to the user's own servers: that is what they are for.
constexpr std::array<std::string_view, 2> viewer_hosts{"app.foxglove.dev", "studio.foxglove.dev"};

/// The value behind `key` in a list such as "a=1&token=x"; empty where there is none.
std::string_view value_in(std::string_view list, std::string_view key, char separator) {
  while (!list.empty()) {
    std::string_view entry = list.substr(0, list.find(separator));
    list.remove_prefix(std::min(entry.size() + 1, list.size()));
    while (entry.starts_with(' ')) entry.remove_prefix(1);
    if (entry.starts_with(key)) return entry.substr(key.size());
  }
  return {};
}

std::string_view token_in_query(std::string_view target) {
  const std::size_t begin = target.find('?');
  if (begin == std::string_view::npos) return {};
  return value_in(target.substr(begin + 1), token_key, '&');
}

/// "localhost" of "localhost:8765", "[::1]" of "[::1]:8765".
std::string_view without_port(std::string_view host) {
  const std::size_t colon = host.rfind(':');
  const bool has_port = colon != std::string_view::npos &&
                        host.find_first_not_of("0123456789", colon + 1) == std::string_view::npos;
  return has_port ? host.substr(0, colon) : host;
}

/// Of 127.0.0.0/8; a name that only begins like one is none.
bool is_loopback_address(const std::string& host) {
  in_addr address{};
  return inet_pton(AF_INET, host.c_str(), &address) == 1 && ntohl(address.s_addr) >> 24U == 127U;
}

bool is_this_machine(std::string_view host) {
  return host == "localhost" || host == "[::1]" || is_loopback_address(std::string(host));
}

/// "localhost:8080" of "http://localhost:8080".
std::string_view host_of_origin(std::string_view origin) {
  const std::size_t slashes = origin.find("://");
  return slashes == std::string_view::npos ? origin : origin.substr(slashes + 3);
}

}  // namespace

AccessPolicy::Verdict AccessPolicy::judge(const RequestIdentity& request) const {
  using enum Verdict;
  if (!options_.token.empty()) {
    // Who has the token was given it: a cookie, though, goes along with requests of any page.
    if (is_token(token_in_query(request.target))) return allowed;
    if (!has_token(request)) return no_token;
  }
  if (options_.local_only && !is_this_machine(without_port(request.host))) return wrong_host;
  return allows_origin(request) ? allowed : wrong_origin;
}

bool AccessPolicy::has_token(const RequestIdentity& request) const {
  constexpr std::string_view bearer = "Bearer ";
  if (request.authorization.starts_with(bearer)) {
    return is_token(request.authorization.substr(bearer.size()));
  }
  return is_token(value_in(request.cookie, cookie_key, ';'));
}

bool AccessPolicy::is_token(std::string_view text) const {
  if (text.size() != options_.token.size()) return false;
  // Takes as long whatever is wrong: nobody finds the token letter by letter.
  unsigned int difference = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    difference |= static_cast<unsigned char>(text[i]) ^
                  static_cast<unsigned int>(static_cast<unsigned char>(options_.token[i]));
  }
  return difference == 0;
}

bool AccessPolicy::allows_origin(const RequestIdentity& request) const {
  // Programs that are no browser say none.
  if (request.origin.empty()) return true;
  const std::string_view host = host_of_origin(request.origin);
  if (host == request.host || is_this_machine(without_port(host))) return true;
  // Desktop applications: pages of files have no origin that could be named.
  if (request.origin == "file://") return true;
  return std::ranges::find(viewer_hosts, host) != viewer_hosts.end() ||
         std::ranges::find(options_.origins, host) != options_.origins.end();
}

std::optional<std::string> AccessPolicy::cookie_for(std::string_view target, bool over_tls) const {
  if (options_.token.empty() || !is_token(token_in_query(target))) return std::nullopt;
  std::string cookie(cookie_key);
  cookie.append(options_.token).append("; Path=/; HttpOnly; SameSite=Strict");
  return over_tls ? cookie + "; Secure" : cookie;
}

std::string_view in_words(AccessPolicy::Verdict verdict) {
  using enum AccessPolicy::Verdict;
  switch (verdict) {
    case no_token:
      return "A token is needed: open the address with ?token=..., as the gateway printed it.\n";
    case wrong_host:
      return "This gateway is for this machine: open it as localhost or 127.0.0.1.\n";
    case wrong_origin:
      return "Pages of this origin may not connect: start the gateway with --origin HOST.\n";
    case allowed:
      break;
  }
  return "";
}

std::string_view path_of(std::string_view target) { return target.substr(0, target.find('?')); }

bool is_local_address(std::string_view address) {
  const std::string_view host = without_port(address);
  return host.starts_with("127.") || host == "[::1]";
}

}  // namespace stillmap::gateway
