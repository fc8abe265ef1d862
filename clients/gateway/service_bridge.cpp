#include "clients/gateway/service_bridge.hpp"

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <list>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "idl/dds/dds_error.hpp"
#include "idl/dds/service_client.hpp"
#include "idl/interface/services.hpp"

namespace stillmap::gateway {
namespace {

using eprosima::fastdds::dds::TypeSupport;

/// Calls that wait for one service: of all clients, and of each.
constexpr std::size_t max_waiting_calls = 256;
constexpr std::size_t max_waiting_calls_of_client = 16;

bool is_sample_of(const TypeSupport& type, dds::SerializedSample& bytes) {
  TypeSupport mutable_type = type;
  void* const sample = mutable_type->createData();
  const bool is_one = dds::from_bytes(mutable_type, bytes, sample);
  mutable_type->deleteData(sample);
  return is_one;
}

}  // namespace

/// The calls of one service, clients in turn. Its thread and its endpoints are made with the first.
class ServiceBridge::Caller {
 public:
  using Clock = std::chrono::steady_clock;
  struct Service {
    /// ROS 2 name without the first slash.
    std::string name;
    TypeSupport request;
    TypeSupport reply;
  };
  struct Call {
    Client client;
    dds::SerializedSample request;
    std::function<void(Answer)> answered;
    /// Set by add().
    Clock::time_point deadline;
  };

  Caller(dds::Participant& participant, Service service, std::chrono::milliseconds timeout)
      : participant_(participant), service_(std::move(service)), timeout_(timeout) {}

  /// False when too many wait.
  [[nodiscard]] bool add(Call call) {
    call.deadline = Clock::now() + timeout_;
    const std::scoped_lock lock(mutex_);
    auto queue = std::ranges::find_if(
        waiting_, [&](const Queue& other) { return is_same(other.front().client, call.client); });
    if (waiting_count_ >= max_waiting_calls) return false;
    if (queue == waiting_.end()) queue = waiting_.emplace(waiting_.end());
    if (queue->size() >= max_waiting_calls_of_client) return false;
    queue->push_back(std::move(call));
    ++waiting_count_;
    changed_.notify_one();
    if (!thread_.joinable()) {
      thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
    }
    return true;
  }

 private:
  /// Of one client; never empty.
  using Queue = std::deque<Call>;

  static bool is_same(const Client& a, const Client& b) {
    return !a.owner_before(b) && !b.owner_before(a);
  }

  void run(const std::stop_token& stop) {
    while (std::optional<Call> call = next(stop)) {
      // Nobody knows any more that it was asked for: a reset that comes late is worse than none.
      if (call->client.expired()) continue;
      call->answered(answer(*call, stop));
    }
  }

  std::optional<Call> next(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    if (!changed_.wait(lock, stop, [this] { return !waiting_.empty(); })) return std::nullopt;
    Queue queue = std::move(waiting_.front());
    waiting_.pop_front();
    std::optional<Call> call = std::move(queue.front());
    queue.pop_front();
    if (!queue.empty()) waiting_.push_back(std::move(queue));
    --waiting_count_;
    return call;
  }

  [[nodiscard]] Answer answer(Call& call, const std::stop_token& stop) {
    if (!is_sample_of(service_.request, call.request)) {
      return "the request is no " + dds::ros_type_name(service_.request) + " in CDR";
    }
    if (time_left(call).count() <= 0) return no_answer("it waited for other calls: ask again");
    try {
      if (!client_) client_.emplace(participant_, service_.name, service_.request, service_.reply);
      const bool found = wait_for_server(call, stop);
      if (call.client.expired()) return std::string();
      auto reply = found && time_left(call).count() > 0
                       ? client_->call(call.request, time_left(call), stop)
                       : std::nullopt;
      if (reply) return *std::move(reply);
      return found ? no_answer("a server is there but too busy, or it was just killed")
                   : no_answer("no server found ('stillmap doctor' looks for the reason)");
    } catch (const dds::DdsError& error) {
      return std::string(error.what());
    }
  }

  [[nodiscard]] static std::chrono::milliseconds time_left(const Call& call) {
    return std::chrono::ceil<std::chrono::milliseconds>(call.deadline - Clock::now());
  }

  [[nodiscard]] bool wait_for_server(const Call& call, const std::stop_token& stop) const {
    constexpr std::chrono::milliseconds period(100);
    while (time_left(call).count() > 0 && !stop.stop_requested()) {
      if (client_->wait_for_server(std::min(period, time_left(call)))) return true;
    }
    return false;
  }

  [[nodiscard]] std::string no_answer(const std::string& why) const {
    return "no answer from service " + service_.name + " in DDS domain " +
           std::to_string(participant_.options().domain_id) + " within " +
           std::to_string(timeout_.count()) + " ms: " + why;
  }

  dds::Participant& participant_;
  Service service_;
  std::chrono::milliseconds timeout_;
  std::optional<dds::UntypedServiceClient> client_;
  std::mutex mutex_;
  std::condition_variable_any changed_;
  /// The client whose turn it is first.
  std::list<Queue> waiting_;
  std::size_t waiting_count_ = 0;
  std::jthread thread_;
};

ServiceBridge::ServiceBridge(dds::Participant& participant, const ServiceChoice& choice, Post post)
    : post_(std::move(post)) {
  std::uint32_t id = 0;
  dds::for_each_service([&]<typename Request, typename Reply>(
                            const dds::ServiceSpec<Request, Reply>& spec) {
    if (spec.effect == dds::ServiceEffect::modifies && !choice.with_control) return;
    Caller::Service service{.name = spec.in(choice.server_name),
                            .request = dds::type_support<Request>(),
                            .reply = dds::type_support<Reply>()};
    std::string type = dds::ros_type_name(service.request);
    type.resize(type.rfind("_Request"));
    infos_.push_back({.id = ++id, .name = "/" + service.name, .type = std::move(type)});
    callers_.push_back(std::make_unique<Caller>(participant, std::move(service), choice.timeout));
  });
}

ServiceBridge::~ServiceBridge() = default;

void ServiceBridge::call(std::uint32_t service, Client client, dds::SerializedSample request,
                         std::function<void(Answer)> answered) {
  const auto hand_back = [post = post_, answered](Answer answer) {
    post([answered, answer = std::move(answer)]() mutable { answered(std::move(answer)); });
  };
  if (callers_.at(service - 1)
          ->add({.client = std::move(client),
                 .request = std::move(request),
                 .answered = hand_back,
                 .deadline = {}})) {
    return;
  }
  answered("too many calls of " + infos_.at(service - 1).name + " wait; ask again later");
}

}  // namespace stillmap::gateway
