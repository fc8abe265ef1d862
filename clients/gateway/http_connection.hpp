#pragma once

#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include "clients/gateway/access_policy.hpp"
#include "clients/gateway/connection_limit.hpp"
#include "clients/gateway/web_site.hpp"
#include "clients/gateway/websocket_connection.hpp"

namespace stillmap::gateway {

/// What connections need of the server, which outlives them.
struct ServerContext {
  AccessPolicy access;
  const WebSite& site;
  MakeSession make_session;
};

/// Requests of one connection, one after the other, until it becomes a WebSocket or ends. Lives as
/// long as one of its steps is to come. `Stream` is a tcp_stream or an ssl_stream of one.
template <typename Stream>
class HttpConnection : public std::enable_shared_from_this<HttpConnection<Stream>> {
 public:
  HttpConnection(Stream stream, std::shared_ptr<const ServerContext> context,
                 std::shared_ptr<ConnectionLimit::Lease> lease)
      : stream_(std::move(stream)), context_(std::move(context)), lease_(std::move(lease)) {}

  /// With TLS, its handshake comes first.
  void begin() {
    lease_->close_with([weak = this->weak_from_this()] {
      if (const auto self = weak.lock()) boost::beast::get_lowest_layer(self->stream_).close();
    });
    if constexpr (is_tls) {
      boost::beast::get_lowest_layer(stream_).expires_after(handshake_timeout);
      stream_.async_handshake(Stream::server, [self = this->shared_from_this()](error_code error) {
        if (!error) self->read();
      });
    } else {
      read();
    }
  }

 private:
  using error_code = boost::system::error_code;
  static constexpr bool is_tls = !std::is_same_v<Stream, boost::beast::tcp_stream>;
  static constexpr std::chrono::seconds handshake_timeout{5};
  /// For the next request of a connection to come whole, and for an answer to be taken.
  static constexpr std::chrono::seconds request_timeout{15};
  static constexpr std::chrono::seconds answer_timeout{60};
  /// For a refused request to end.
  static constexpr std::chrono::seconds drop_timeout{2};
  static constexpr std::uint32_t max_header_bytes = 16384;

  void read() {
    parser_.emplace();
    parser_->header_limit(max_header_bytes);
    parser_->body_limit(0);
    boost::beast::get_lowest_layer(stream_).expires_after(request_timeout);
    boost::beast::http::async_read(
        stream_, buffer_, *parser_,
        [self = this->shared_from_this()](error_code error, std::size_t) {
          if (!error) return self->answer();
          self->refuse(error);
        });
  }

  /// Of what cannot be read, answers what is HTTP.
  void refuse(error_code error) {
    namespace http = boost::beast::http;
    const bool has_body = error == http::error::body_limit;
    if (!has_body && error != http::error::header_limit) return;
    HttpResponse refusal = has_body
                               ? text_response({}, http::status::payload_too_large,
                                               "Requests have no body: GET is answered.\n")
                               : text_response({}, http::status::request_header_fields_too_large,
                                               "Headers have 16 KiB at most.\n");
    refusal.keep_alive(false);
    is_unread_ = true;
    write(std::move(refusal));
  }

  void answer() {
    namespace http = boost::beast::http;
    HttpRequest request = parser_->release();
    const auto verdict = context_->access.judge(identity_of(request));
    if (verdict != AccessPolicy::Verdict::allowed) {
      const bool needs_token = verdict == AccessPolicy::Verdict::no_token;
      HttpResponse refusal =
          text_response(request, needs_token ? http::status::unauthorized : http::status::forbidden,
                        std::string(in_words(verdict)));
      refusal.keep_alive(false);
      return write(std::move(refusal));
    }
    lease_->raise(ConnectionLimit::Standing::allowed);
    if (boost::beast::websocket::is_upgrade(request)) return upgrade(std::move(request));
    // An answer may take as long as the server behind us.
    boost::beast::get_lowest_layer(stream_).expires_never();
    const auto cookie = context_->access.cookie_for(view(request.target()), is_tls);
    const bool is_head = request.method() == http::verb::head;
    context_->site.answer(
        request, [self = this->shared_from_this(), cookie, is_head](HttpResponse response) {
          if (cookie) response.set(http::field::set_cookie, *cookie);
          // Its length is still said.
          if (is_head) response.body().clear();
          self->write(std::move(response));
        });
  }

  void upgrade(HttpRequest request) {
    const std::string_view protocol = chosen_subprotocol(request);
    if (protocol.empty()) {
      return write(text_response(
          request, boost::beast::http::status::bad_request,
          "WebSockets speak foxglove.sdk.v1 or foxglove.websocket.v1 (Sec-WebSocket-Protocol).\n"));
    }
    boost::beast::get_lowest_layer(stream_).expires_never();
    lease_->raise(ConnectionLimit::Standing::session);
    std::make_shared<WebSocketConnection<Stream>>(std::move(stream_), std::move(lease_))
        ->begin(std::move(request), std::string(protocol), context_->make_session);
  }

  void write(HttpResponse response) {
    response_ = std::move(response);
    boost::beast::get_lowest_layer(stream_).expires_after(answer_timeout);
    boost::beast::http::async_write(
        stream_, *response_, [self = this->shared_from_this()](error_code error, std::size_t) {
          if (!error && self->response_->keep_alive()) return self->read();
          error_code has_gone;
          boost::beast::get_lowest_layer(self->stream_)
              .socket()
              .shutdown(boost::asio::ip::tcp::socket::shutdown_send, has_gone);
          if (error || !self->is_unread_) return;
          boost::beast::get_lowest_layer(self->stream_).expires_after(drop_timeout);
          self->drop_rest();
        });
  }

  /// A socket that is closed with bytes unread takes the answer from who still sends.
  void drop_rest() {
    buffer_.clear();
    boost::beast::get_lowest_layer(stream_).async_read_some(
        buffer_.prepare(max_header_bytes),
        [self = this->shared_from_this()](error_code error, std::size_t) {
          if (!error) self->drop_rest();
        });
  }

  static std::string_view view(boost::beast::string_view text) {
    return {text.data(), text.size()};
  }

  static RequestIdentity identity_of(const HttpRequest& request) {
    using boost::beast::http::field;
    return {.target = view(request.target()),
            .host = view(request[field::host]),
            .origin = view(request[field::origin]),
            .authorization = view(request[field::authorization]),
            .cookie = view(request[field::cookie])};
  }

  Stream stream_;
  std::shared_ptr<const ServerContext> context_;
  std::shared_ptr<ConnectionLimit::Lease> lease_;
  boost::beast::flat_buffer buffer_;
  std::optional<boost::beast::http::request_parser<boost::beast::http::string_body>> parser_;
  std::optional<HttpResponse> response_;
  bool is_unread_ = false;
};

}  // namespace stillmap::gateway
