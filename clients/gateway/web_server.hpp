#pragma once

#include <boost/asio/io_context.hpp>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "clients/gateway/access_policy.hpp"
#include "clients/gateway/session.hpp"
#include "clients/gateway/web_site.hpp"

namespace stillmap::gateway {

/// Files in PEM.
struct TlsFiles {
  std::filesystem::path certificate;
  std::filesystem::path key;
};

struct WebServerOptions {
  /// As 127.0.0.1:8765 or [::1]:8765; port 0 is any that is free.
  std::string address = "127.0.0.1:8765";
  AccessOptions access;
  /// Empty certificate: no TLS.
  TlsFiles tls;
};

/// Listens, serves the site over HTTP and Foxglove's protocol over WebSocket, both with or without
/// TLS. Connections that stay silent, drip or do not read hold up nobody: requests and handshakes
/// must come in time and in bounds, and a WebSocket whose other end does not answer pings is closed
/// after half a minute. All of it runs in the thread of `io`.
class WebServer {
 public:
  /// Throws std::invalid_argument that names the address or the file that cannot be used.
  WebServer(boost::asio::io_context& io, const WebServerOptions& options, const WebSite& site,
            MakeSession make_session);
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  /// That was free, for port 0.
  [[nodiscard]] std::uint16_t port() const;

 private:
  class Listener;
  std::shared_ptr<Listener> listener_;
};

}  // namespace stillmap::gateway
