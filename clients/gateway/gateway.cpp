#include "clients/gateway/gateway.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <chrono>
#include <mutex>
#include <nlohmann/json.hpp>
#include <random>
#include <utility>
#include <vector>

#include "clients/library/tcp_rejoin_backoff.hpp"
#include "idl/dds/service_client.hpp"
#include "idl/interface/services.hpp"
#include "idl/interface/topics.hpp"

namespace stillmap::gateway {
namespace {

using stillmap_msgs::srv::GetStatus_Request;
using stillmap_msgs::srv::GetStatus_Response;

/// Or says that we may not ask.
bool is_answered(dds::Participant& participant, const std::string& service,
                 std::chrono::milliseconds timeout) {
  dds::ServiceClient<GetStatus_Request, GetStatus_Response> client(participant, service);
  GetStatus_Request request;
  request.format_version(dds::wire_format_version);
  return !client.refusal().empty() || client.call(request, timeout).has_value();
}

/// Over TCP, whoever is there first may have to join again: as the client library does.
std::unique_ptr<dds::Participant> join_domain(const GatewayOptions& options) {
  auto participant = std::make_unique<dds::Participant>(options.dds);
  if (options.dds.transport != dds::NetworkTransport::tcp) return participant;
  const std::string service = dds::services::get_status.in(options.services.server_name);
  TcpRejoinBackoff backoff(options.dds, options.services.timeout);
  while (!is_answered(*participant, service, backoff.next_wait()) && !backoff.timed_out()) {
    if (!backoff.rejoin_due()) continue;
    participant = nullptr;
    participant = std::make_unique<dds::Participant>(options.dds);
  }
  return participant;
}

std::string random_id() {
  std::random_device device;
  return std::to_string(device()) + std::to_string(device());
}

nlohmann::json to_json(const Session& session) {
  nlohmann::json topics = nlohmann::json::array();
  for (const TopicTraffic& traffic : session.traffic()) {
    topics.push_back(
        {{"topic", traffic.topic}, {"sent", traffic.sent}, {"dropped", traffic.dropped}});
  }
  return {{"topics", topics}, {"waiting_bytes", session.outbox().waiting_bytes()}};
}

}  // namespace

class Gateway::Parts {
 public:
  explicit Parts(const GatewayOptions& options)
      : options_(options),
        participant_(join_domain(options)),
        inbox_(std::make_shared<Inbox>(*io_)),
        topics_(*participant_, options.topics, post()),
        services_(*participant_, options.services, post()),
        operator_topics_(*participant_),
        tiles_(*participant_, options.services.server_name, options.services.timeout, post()),
        site_(options.page.empty() ? StaticFiles() : StaticFiles(options.page), tiles_,
              [this] { return state_json(); }),
        server_(std::make_unique<WebServer>(
            *io_, options.web, site_,
            [this](Session::Events events) { return make_session(std::move(events)); })) {}

  ~Parts() {
    inbox_->close();
    server_ = nullptr;
    tiles_.forget_waiting();
    // Connections end with it, and stop listening to topics.
    io_ = nullptr;
  }
  Parts(const Parts&) = delete;
  Parts& operator=(const Parts&) = delete;

  [[nodiscard]] std::uint16_t port() const { return server_->port(); }
  void run_for(std::chrono::milliseconds time) { io_->run_for(time); }

 private:
  /// Hands work to an io_context until that is closed.
  class Inbox {
   public:
    explicit Inbox(boost::asio::io_context& io) : io_(&io) {}
    void post(std::function<void()> work) {
      const std::scoped_lock lock(mutex_);
      if (io_ != nullptr) boost::asio::post(*io_, std::move(work));
    }
    void close() {
      const std::scoped_lock lock(mutex_);
      io_ = nullptr;
    }

   private:
    std::mutex mutex_;
    boost::asio::io_context* io_;
  };

  [[nodiscard]] Post post() const {
    return [inbox = inbox_](std::function<void()> work) { inbox->post(std::move(work)); };
  }

  std::shared_ptr<Session> make_session(Session::Events events) {
    std::erase_if(sessions_, [](const auto& session) { return session.expired(); });
    auto session =
        std::make_shared<Session>(Bridges{topics_, services_, operator_topics_}, std::move(events));
    sessions_.push_back(session);
    session->begin("Stillmap " + options_.topics.server_name, id_);
    return session;
  }

  [[nodiscard]] std::string state_json() const {
    nlohmann::json clients = nlohmann::json::array();
    for (const auto& weak : sessions_) {
      if (const auto session = weak.lock()) clients.push_back(to_json(*session));
    }
    return nlohmann::json{{"server", options_.topics.server_name},
                          {"domain", options_.dds.domain_id},
                          {"format_version", dds::wire_format_version},
                          {"control", options_.services.with_control},
                          {"points", options_.topics.points},
                          {"timeout_ms", options_.services.timeout.count()},
                          {"clients", clients}}
        .dump();
  }

  GatewayOptions options_;
  std::string id_ = random_id();
  std::unique_ptr<boost::asio::io_context> io_ = std::make_unique<boost::asio::io_context>(1);
  std::unique_ptr<dds::Participant> participant_;
  std::shared_ptr<Inbox> inbox_;
  std::vector<std::weak_ptr<Session>> sessions_;
  TopicBridge topics_;
  ServiceBridge services_;
  OperatorTopics operator_topics_;
  TileSource tiles_;
  WebSite site_;
  std::unique_ptr<WebServer> server_;
};

Gateway::Gateway(const GatewayOptions& options) : parts_(std::make_unique<Parts>(options)) {}
Gateway::~Gateway() = default;

std::uint16_t Gateway::port() const { return parts_->port(); }
void Gateway::run_for(std::chrono::milliseconds time) { parts_->run_for(time); }

}  // namespace stillmap::gateway
