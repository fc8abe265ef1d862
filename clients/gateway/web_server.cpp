#include "clients/gateway/web_server.hpp"

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <stdexcept>
#include <utility>

#include "clients/gateway/connection_limit.hpp"
#include "clients/gateway/http_connection.hpp"
#include "clients/gateway/tls_connection.hpp"
#include "clients/gateway/websocket_connection.hpp"

namespace stillmap::gateway {
namespace {

using boost::asio::ip::tcp;
using boost::system::error_code;
namespace ssl = boost::asio::ssl;

constexpr std::size_t max_connections = 256;
/// Before connections are accepted again after that failed, as without free file descriptors.
constexpr std::chrono::milliseconds retry_period(200);

tcp::endpoint endpoint_of(const std::string& address) {
  const std::size_t colon = address.rfind(':');
  std::string host = address.substr(0, colon);
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  return {boost::asio::ip::make_address(host),
          static_cast<std::uint16_t>(std::stoi(address.substr(colon + 1)))};
}

std::optional<ssl::context> tls_context(const TlsFiles& files) {
  if (files.certificate.empty()) return std::nullopt;
  try {
    ssl::context context(ssl::context::tls_server);
    context.set_options(ssl::context::default_workarounds | ssl::context::no_tlsv1 |
                        ssl::context::no_tlsv1_1);
    context.use_certificate_chain_file(files.certificate.string());
    context.use_private_key_file(files.key.string(), ssl::context::pem);
    return context;
  } catch (const boost::system::system_error& error) {
    throw std::invalid_argument("certificate '" + files.certificate.string() + "' and key '" +
                                files.key.string() + "' cannot be used (" + error.what() +
                                "): PEM files of one pair are needed");
  }
}

}  // namespace

std::string_view chosen_subprotocol(const HttpRequest& request) {
  const auto named = request[boost::beast::http::field::sec_websocket_protocol];
  std::string_view list(named.data(), named.size());
  while (!list.empty()) {
    std::string_view name = list.substr(0, list.find(','));
    list.remove_prefix(std::min(name.size() + 1, list.size()));
    while (name.starts_with(' ')) name.remove_prefix(1);
    while (name.ends_with(' ')) name.remove_suffix(1);
    for (const std::string_view known : foxglove_subprotocols) {
      if (name == known) return known;
    }
  }
  return {};
}

class WebServer::Listener : public std::enable_shared_from_this<Listener> {
 public:
  Listener(boost::asio::io_context& io, const WebServerOptions& options, const WebSite& site,
           MakeSession make_session)
      : context_(std::make_shared<const ServerContext>(
            ServerContext{AccessPolicy(options.access), site, std::move(make_session)})),
        tls_(tls_context(options.tls)),
        acceptor_(io, endpoint_of(options.address)),
        retry_(io) {}

  void begin() {
    limit_ = std::make_shared<ConnectionLimit>(max_connections, [weak = weak_from_this()] {
      if (const auto self = weak.lock()) self->accept();
    });
    accept();
  }

  void accept() {
    if (is_accepting_ || has_ended_ || limit_->is_reached()) return;
    is_accepting_ = true;
    acceptor_.async_accept([self = shared_from_this()](error_code error, tcp::socket socket) {
      self->is_accepting_ = false;
      if (self->has_ended_) return;
      if (error) return self->accept_later();
      self->serve(std::move(socket));
      if (self->limit_->is_reached()) self->limit_->close_one();
      // Where that closed none, the end of one lets the next in.
      self->accept();
    });
  }

  void end() {
    has_ended_ = true;
    limit_->end();
    error_code none;
    acceptor_.close(none);
    retry_.cancel();
  }

  [[nodiscard]] std::uint16_t port() const { return acceptor_.local_endpoint().port(); }

 private:
  void serve(tcp::socket socket) {
    boost::beast::tcp_stream stream(std::move(socket));
    if (!tls_) {
      std::make_shared<HttpConnection<boost::beast::tcp_stream>>(std::move(stream), context_,
                                                                 limit_->lend())
          ->begin();
      return;
    }
    serve_over_tls(std::move(stream), *tls_, context_, limit_->lend());
  }

  void accept_later() {
    retry_.expires_after(retry_period);
    retry_.async_wait([self = shared_from_this()](error_code error) {
      if (!error) self->accept();
    });
  }

  std::shared_ptr<const ServerContext> context_;
  std::optional<ssl::context> tls_;
  tcp::acceptor acceptor_;
  boost::asio::steady_timer retry_;
  std::shared_ptr<ConnectionLimit> limit_;
  bool is_accepting_ = false;
  bool has_ended_ = false;
};

WebServer::WebServer(boost::asio::io_context& io, const WebServerOptions& options,
                     const WebSite& site, MakeSession make_session) {
  try {
    listener_ = std::make_shared<Listener>(io, options, site, std::move(make_session));
  } catch (const boost::system::system_error& error) {
    throw std::invalid_argument("--listen " + options.address + " cannot be listened on (" +
                                error.what() +
                                "): is the port taken, or the address not this machine's?");
  }
  listener_->begin();
}

WebServer::~WebServer() { listener_->end(); }

std::uint16_t WebServer::port() const { return listener_->port(); }

}  // namespace stillmap::gateway
