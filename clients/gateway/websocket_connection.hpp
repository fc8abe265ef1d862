#pragma once

#include <netinet/tcp.h>

#include <array>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "clients/gateway/foxglove_protocol.hpp"
#include "clients/gateway/session.hpp"
#include "clients/gateway/web_site.hpp"

namespace stillmap::gateway {

/// The first of the subprotocols that the client names and this side knows; empty without one.
[[nodiscard]] std::string_view chosen_subprotocol(const HttpRequest& request);

/// Carries one client's session. One message at a time is under way: what comes meanwhile waits in
/// the session's outbox, where newer replaces older. Lives as long as one of its steps is to come.
template <typename Stream>
class WebSocketConnection : public std::enable_shared_from_this<WebSocketConnection<Stream>> {
 public:
  WebSocketConnection(Stream stream, std::shared_ptr<void> lease)
      : lease_(std::move(lease)),
        socket_(std::move(stream)),
        large_pause_(socket_.get_executor()),
        report_(socket_.get_executor()) {}

  ~WebSocketConnection() {
    if (session_) session_->end();
  }
  WebSocketConnection(const WebSocketConnection&) = delete;
  WebSocketConnection& operator=(const WebSocketConnection&) = delete;

  void begin(HttpRequest request, const std::string& protocol, const MakeSession& make_session) {
    namespace websocket = boost::beast::websocket;
    request_ = std::move(request);
    socket_.set_option(websocket::stream_base::timeout{.handshake_timeout = handshake_timeout,
                                                       .idle_timeout = idle_timeout,
                                                       .keep_alive_pings = true});
    socket_.set_option(websocket::stream_base::decorator([protocol](auto& response) {
      response.set(boost::beast::http::field::sec_websocket_protocol, protocol);
    }));
    socket_.read_message_max(max_message_bytes);
    // Between the parts of a message, pings and their answers find their way: one that takes longer
    // than the idle timeout would else end the connection.
    socket_.auto_fragment(true);
    socket_.write_buffer_bytes(fragment_bytes);
    limit_unsent_bytes();
    socket_.async_accept(request_, [self = this->shared_from_this(), make_session](auto error) {
      if (!error) self->start(make_session);
    });
  }

 private:
  using error_code = boost::system::error_code;
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds handshake_timeout{5};
  static constexpr std::chrono::seconds idle_timeout{30};
  static constexpr std::chrono::seconds report_period{5};
  static constexpr std::size_t max_message_bytes = 1U << 20U;
  static constexpr std::size_t fragment_bytes = 128U << 10U;
  /// Large messages that take longer than this are followed by a pause of as long.
  static constexpr std::chrono::milliseconds noticeable_write{50};

  /// Else the kernel takes megabytes, behind which the next pose waits.
  void limit_unsent_bytes() {
    constexpr int max_unsent_bytes = 128 << 10;
    const auto socket = boost::beast::get_lowest_layer(socket_).socket().native_handle();
    static_cast<void>(::setsockopt(socket, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &max_unsent_bytes,
                                   sizeof(max_unsent_bytes)));
    const int no_delay = 1;
    static_cast<void>(::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &no_delay, sizeof(no_delay)));
  }

  void start(const MakeSession& make_session) {
    const std::weak_ptr<WebSocketConnection> weak = this->weak_from_this();
    session_ = make_session({.has_output =
                                 [weak] {
                                   if (const auto self = weak.lock()) self->write_next();
                                 },
                             .failed =
                                 [weak](const std::string& why) {
                                   if (const auto self = weak.lock()) self->give_up(why);
                                 }});
    // What it said at once, before it was ours.
    write_next();
    read();
    report_later();
  }

  void read() {
    socket_.async_read(buffer_, [self = this->shared_from_this()](error_code error, std::size_t) {
      if (error) return self->finish();
      self->handle();
      if (!self->is_closing_) self->read();
    });
  }

  void handle() {
    const auto data = buffer_.cdata();
    const auto* const bytes = static_cast<const std::uint8_t*>(data.data());
    if (socket_.got_text()) {
      session_->take_text({reinterpret_cast<const char*>(bytes), data.size()});
    } else {
      session_->take_binary({bytes, data.size()});
    }
    buffer_.consume(buffer_.size());
  }

  void write_next() {
    if (is_writing_ || is_closing_ || !session_) return;
    item_ = session_->outbox().next(!is_pausing_);
    if (!item_) return;
    is_writing_ = true;
    write_began_ = Clock::now();
    socket_.binary(!std::holds_alternative<std::string>(*item_));
    // Of one type whatever is sent: each other one would cost the compiler half a minute.
    const std::array<boost::asio::const_buffer, 2> parts = buffers_of(*item_);
    socket_.async_write(parts, [self = this->shared_from_this()](error_code error, std::size_t) {
      self->written(error);
    });
  }

  std::array<boost::asio::const_buffer, 2> buffers_of(const Outbox::Item& item) {
    if (const auto* const text = std::get_if<std::string>(&item)) {
      return {boost::asio::const_buffer(), boost::asio::buffer(*text)};
    }
    if (const auto* const answer = std::get_if<std::vector<std::uint8_t>>(&item)) {
      return {boost::asio::const_buffer(), boost::asio::buffer(*answer)};
    }
    const auto& data = std::get<Outbox::Data>(item);
    header_ = message_header(data.subscription, data.message->received_ns);
    return {boost::asio::buffer(header_), boost::asio::buffer(data.message->bytes)};
  }

  void written(error_code error) {
    is_writing_ = false;
    if (error) return finish();
    const auto took = Clock::now() - write_began_;
    if (!session_->outbox().is_small(*item_) && took > noticeable_write) pause_large(took);
    item_.reset();
    write_next();
  }

  /// On a slow connection, small messages have it for themselves half of the time.
  void pause_large(Clock::duration length) {
    is_pausing_ = true;
    large_pause_.expires_after(length);
    large_pause_.async_wait([weak = this->weak_from_this()](error_code) {
      const auto self = weak.lock();
      if (!self) return;
      self->is_pausing_ = false;
      self->write_next();
    });
  }

  void report_later() {
    report_.expires_after(report_period);
    report_.async_wait([weak = this->weak_from_this()](error_code error) {
      const auto self = weak.lock();
      if (error || !self || self->is_closing_) return;
      self->session_->report_dropped();
      self->report_later();
    });
  }

  /// Closes with a reason in words; what is under way is not waited for.
  void give_up(const std::string& why) {
    if (is_closing_) return;
    is_closing_ = true;
    boost::asio::post(socket_.get_executor(), [self = this->shared_from_this(), why] {
      if (self->is_writing_) return self->drop();
      self->socket_.async_close({boost::beast::websocket::close_code::policy_error, why},
                                [self](error_code) { self->drop(); });
    });
  }

  void finish() {
    is_closing_ = true;
    report_.cancel();
    large_pause_.cancel();
    if (session_) session_->end();
  }

  void drop() {
    finish();
    boost::beast::get_lowest_layer(socket_).close();
  }

  std::shared_ptr<void> lease_;
  boost::beast::websocket::stream<Stream> socket_;
  HttpRequest request_;
  boost::beast::flat_buffer buffer_;
  boost::asio::steady_timer large_pause_;
  boost::asio::steady_timer report_;
  std::shared_ptr<Session> session_;
  /// Being written.
  std::optional<Outbox::Item> item_;
  MessageHeader header_{};
  Clock::time_point write_began_;
  bool is_writing_ = false;
  bool is_pausing_ = false;
  bool is_closing_ = false;
};

}  // namespace stillmap::gateway
