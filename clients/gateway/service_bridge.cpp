#include "clients/gateway/service_bridge.hpp"

#include <condition_variable>
#include <deque>
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

/// Calls of all clients that wait for one service.
constexpr std::size_t max_waiting_calls = 64;

bool is_sample_of(const TypeSupport& type, dds::SerializedSample& bytes) {
  TypeSupport mutable_type = type;
  void* const sample = mutable_type->createData();
  const bool is_one = dds::from_bytes(mutable_type, bytes, sample);
  mutable_type->deleteData(sample);
  return is_one;
}

}  // namespace

/// The calls of one service. Its thread and its endpoints are made with the first.
class ServiceBridge::Caller {
 public:
  struct Service {
    /// ROS 2 name without the first slash.
    std::string name;
    TypeSupport request;
    TypeSupport reply;
  };
  struct Call {
    dds::SerializedSample request;
    std::function<void(Answer)> answered;
  };

  Caller(dds::Participant& participant, Service service, std::chrono::milliseconds timeout)
      : participant_(participant), service_(std::move(service)), timeout_(timeout) {}

  /// False when too many wait.
  [[nodiscard]] bool add(Call call) {
    const std::scoped_lock lock(mutex_);
    if (calls_.size() >= max_waiting_calls) return false;
    calls_.push_back(std::move(call));
    changed_.notify_one();
    if (!thread_.joinable()) {
      thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
    }
    return true;
  }

 private:
  void run(const std::stop_token& stop) {
    while (std::optional<Call> call = next(stop)) {
      call->answered(answer(call->request, stop));
    }
  }

  std::optional<Call> next(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    if (!changed_.wait(lock, stop, [this] { return !calls_.empty(); })) return std::nullopt;
    std::optional<Call> call = std::move(calls_.front());
    calls_.pop_front();
    return call;
  }

  [[nodiscard]] Answer answer(dds::SerializedSample& request, const std::stop_token& stop) {
    if (!is_sample_of(service_.request, request)) {
      return "the request is no " + dds::ros_type_name(service_.request) + " in CDR";
    }
    try {
      if (!client_) client_.emplace(participant_, service_.name, service_.request, service_.reply);
      const bool found = wait_for_server(stop);
      auto reply = found ? client_->call(request, timeout_, stop) : std::nullopt;
      if (reply) return *std::move(reply);
      return found ? no_answer("a server is there but too busy, or it was just killed")
                   : no_answer("no server found ('stillmap doctor' looks for the reason)");
    } catch (const dds::DdsError& error) {
      return std::string(error.what());
    }
  }

  [[nodiscard]] bool wait_for_server(const std::stop_token& stop) const {
    constexpr std::chrono::milliseconds period(100);
    for (auto left = timeout_; left.count() > 0 && !stop.stop_requested(); left -= period) {
      if (client_->wait_for_server(period)) return true;
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
  std::deque<Call> calls_;
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

void ServiceBridge::call(std::uint32_t service, dds::SerializedSample request,
                         std::function<void(Answer)> answered) {
  const auto hand_back = [post = post_, answered](Answer answer) {
    post([answered, answer = std::move(answer)]() mutable { answered(std::move(answer)); });
  };
  if (callers_.at(service - 1)->add({std::move(request), hand_back})) return;
  answered("too many calls of " + infos_.at(service - 1).name + " wait; ask again later");
}

}  // namespace stillmap::gateway
