#include "server/monitoring/metrics_endpoint.hpp"

#include <prometheus/text_serializer.h>
#include <spdlog/spdlog.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>
#include <chrono>
#include <cstdint>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <utility>

#include "server/monitoring/metrics.hpp"
#include "server/threads/thread_failure.hpp"
#include "server/threads/thread_name.hpp"

namespace stillmap::server {
namespace {

namespace beast = boost::beast;
namespace http = boost::beast::http;
using boost::asio::ip::tcp;
using boost::system::error_code;

using Answer = http::response<http::string_body>;
using Request = http::request<http::empty_body>;

/// For a request to come whole, and for its answer to be taken.
constexpr std::chrono::seconds request_timeout(1);
constexpr std::chrono::seconds answer_timeout(5);
constexpr std::uint32_t max_header_bytes = 8192;
/// At a time; more wait to be accepted.
constexpr int max_connections = 256;
/// Before connections are accepted again after that failed, as without free file descriptors.
constexpr std::chrono::milliseconds retry_period(200);

Answer answer_of(http::status status, std::string text) {
  Answer answer(status, 11, std::move(text));
  answer.set(http::field::content_type, "text/plain; version=0.0.4; charset=utf-8");
  answer.keep_alive(false);
  answer.prepare_payload();
  return answer;
}

/// One connection: a request, its answer, the end. Lives as long as one of its steps is to come.
class Connection : public std::enable_shared_from_this<Connection> {
 public:
  using Respond = std::function<Answer(const Request&)>;

  Connection(tcp::socket socket, const Respond& respond, std::function<void()> on_end)
      : stream_(std::move(socket)), respond_(respond), on_end_(std::move(on_end)) {
    parser_.header_limit(max_header_bytes);
  }
  ~Connection() { on_end_(); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  void begin() {
    stream_.expires_after(request_timeout);
    http::async_read(stream_, buffer_, parser_,
                     [self = shared_from_this()](error_code error, std::size_t) {
                       if (!error) self->reply();
                     });
  }

 private:
  void reply() {
    answer_ = respond_(parser_.get());
    // Its length is still said.
    if (parser_.get().method() == http::verb::head) answer_.body().clear();
    stream_.expires_after(answer_timeout);
    http::async_write(stream_, answer_, [self = shared_from_this()](error_code, std::size_t) {
      error_code has_gone;
      self->stream_.socket().shutdown(tcp::socket::shutdown_send, has_gone);
    });
  }

  beast::tcp_stream stream_;
  const Respond& respond_;
  std::function<void()> on_end_;
  beast::flat_buffer buffer_;
  http::request_parser<http::empty_body> parser_;
  Answer answer_;
};

tcp::endpoint endpoint_of(boost::asio::io_context& io, const std::string& address) {
  const std::size_t colon = address.rfind(':');
  // A port alone: everywhere.
  std::string host = colon == std::string::npos ? "" : address.substr(0, colon);
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  const std::string port = colon == std::string::npos ? address : address.substr(colon + 1);
  return tcp::resolver(io).resolve(host.empty() ? "0.0.0.0" : host, port)->endpoint();
}

}  // namespace

/// All of it runs in one thread.
class MetricsListener {
 public:
  MetricsListener(const std::string& address, Connection::Respond respond)
      : respond_(std::move(respond)), acceptor_(io_, endpoint_of(io_, address)), retry_(io_) {
    accept();
    thread_ = std::jthread([this] {
      name_this_thread("metrics");
      run_or_report([this] { io_.run(); });
    });
  }
  ~MetricsListener() {
    io_.stop();
    thread_.join();
    is_ending_ = true;
  }
  MetricsListener(const MetricsListener&) = delete;
  MetricsListener& operator=(const MetricsListener&) = delete;

  [[nodiscard]] std::uint16_t port() const { return acceptor_.local_endpoint().port(); }

 private:
  void accept() {
    is_accepting_ = true;
    acceptor_.async_accept([this](error_code error, tcp::socket socket) {
      is_accepting_ = false;
      if (error) return accept_later();
      ++connections_;
      std::make_shared<Connection>(std::move(socket), respond_, [this] {
        connection_ended();
      })->begin();
      if (connections_ < max_connections) accept();
    });
  }

  void accept_later() {
    retry_.expires_after(retry_period);
    retry_.async_wait([this](error_code error) {
      if (!error && !is_accepting_) accept();
    });
  }

  void connection_ended() {
    --connections_;
    if (!is_ending_ && !is_accepting_) accept();
  }

  Connection::Respond respond_;
  int connections_ = 0;
  bool is_accepting_ = false;
  bool is_ending_ = false;
  boost::asio::io_context io_{1};
  tcp::acceptor acceptor_;
  boost::asio::steady_timer retry_;
  std::jthread thread_;
};

namespace {

Answer exposition(Metrics& metrics, const std::function<dds::ServerStatus()>& status,
                  const Request& request) {
  const std::string_view target(request.target().data(), request.target().size());
  if (target.substr(0, target.find('?')) != "/metrics") {
    return answer_of(http::status::not_found, "Metrics are at /metrics.\n");
  }
  if (request.method() != http::verb::get) {
    Answer refusal = answer_of(http::status::method_not_allowed, "Metrics are read with GET.\n");
    refusal.set(http::field::allow, "GET");
    return refusal;
  }
  try {
    return answer_of(http::status::ok,
                     prometheus::TextSerializer().Serialize(metrics.collect(status())));
  } catch (const std::exception& error) {
    spdlog::error("metrics cannot be collected: {}", error.what());
    return answer_of(http::status::internal_server_error, std::string(error.what()) + "\n");
  }
}

}  // namespace

MetricsEndpoint::MetricsEndpoint(const std::string& address, Metrics& metrics,
                                 std::function<dds::ServerStatus()> status) {
  try {
    listener_ = std::make_unique<MetricsListener>(
        address, [&metrics, status = std::move(status)](const Request& request) {
          return exposition(metrics, status, request);
        });
  } catch (const std::exception& error) {
    throw std::runtime_error("metrics.address " + address + " cannot be listened on (" +
                             error.what() +
                             "): is the port taken, or the address not this machine's? Choose "
                             "another, or leave it empty to switch metrics off");
  }
  address_ = address.substr(0, address.rfind(':') + 1) + std::to_string(listener_->port());
}

MetricsEndpoint::~MetricsEndpoint() = default;

}  // namespace stillmap::server
