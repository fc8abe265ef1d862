#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

#include "clients/gateway/service_bridge.hpp"
#include "clients/gateway/topic_bridge.hpp"
#include "clients/gateway/web_server.hpp"
#include "idl/dds/dds_options.hpp"

namespace stillmap::gateway {

struct GatewayOptions {
  dds::DdsOptions dds;
  TopicChoice topics;
  ServiceChoice services;
  WebServerOptions web;
  /// The page's folder; empty: no page.
  std::filesystem::path page;
};

/// A server's topics and services, offered to browsers: Foxglove's protocol over WebSocket, and a
/// page over HTTP. All clients are served by one thread, to which readers of DDS hand their
/// samples.
class Gateway {
 public:
  /// Joins the domain and listens. Over TCP it waits for the server, up to the services' timeout.
  /// Throws DdsError, std::invalid_argument for what cannot be used.
  explicit Gateway(const GatewayOptions& options);
  /// Closes all connections.
  ~Gateway();
  Gateway(const Gateway&) = delete;
  Gateway& operator=(const Gateway&) = delete;

  /// Where it listens.
  [[nodiscard]] std::uint16_t port() const;

  /// Serves for so long.
  void run_for(std::chrono::milliseconds time);

 private:
  class Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace stillmap::gateway
