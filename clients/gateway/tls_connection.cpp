#include "clients/gateway/tls_connection.hpp"

#include <boost/beast/ssl.hpp>
#include <boost/beast/websocket/ssl.hpp>
#include <utility>

#include "clients/gateway/http_connection.hpp"

namespace stillmap::gateway {

void serve_over_tls(boost::beast::tcp_stream stream, boost::asio::ssl::context& tls,
                    std::shared_ptr<const ServerContext> context,
                    std::shared_ptr<ConnectionLimit::Lease> lease) {
  using TlsStream = boost::beast::ssl_stream<boost::beast::tcp_stream>;
  std::make_shared<HttpConnection<TlsStream>>(TlsStream(std::move(stream), tls), std::move(context),
                                              std::move(lease))
      ->begin();
}

}  // namespace stillmap::gateway
