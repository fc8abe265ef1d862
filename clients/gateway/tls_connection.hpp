#pragma once

#include <boost/asio/ssl/context.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <memory>

#include "clients/gateway/connection_limit.hpp"

namespace stillmap::gateway {

struct ServerContext;

/// Begins a connection as HttpConnection does, over TLS. In a source of its own: connections of
/// both kinds take the compiler minutes.
void serve_over_tls(boost::beast::tcp_stream stream, boost::asio::ssl::context& tls,
                    std::shared_ptr<const ServerContext> context,
                    std::shared_ptr<ConnectionLimit::Lease> lease);

}  // namespace stillmap::gateway
