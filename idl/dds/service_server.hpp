#pragma once

#include <functional>
#include <string>
#include <thread>
#include <utility>

#include "idl/dds/reader.hpp"
#include "idl/dds/service_identity.hpp"
#include "idl/dds/writer.hpp"

namespace stillmap {

/// Answers the requests of one ROS 2 service, one at a time, on its own thread.
template <typename Request, typename Reply>
class ServiceServer {
 public:
  /// `answer` must not throw. Throws DdsError when the topics cannot be made.
  ServiceServer(Participant& participant, const std::string& service,
                std::function<Reply(const Request&)> answer)
      : answer_(std::move(answer)),
        replies_(participant, reply_topic(service), service_qos()),
        requests_(participant, request_topic(service), service_qos()),
        thread_([this](const std::stop_token& stop) { serve(stop); }) {}

 private:
  void serve(const std::stop_token& stop) {
    Request request;
    eprosima::fastdds::dds::SampleInfo info;
    while (!stop.stop_requested()) {
      if (requests_.take(request, info, stop, std::chrono::seconds(1))) reply(request, info);
    }
  }

  void reply(const Request& request, const eprosima::fastdds::dds::SampleInfo& info) {
    const Reply answer = answer_(request);
    eprosima::fastrtps::rtps::WriteParams params;
    params.related_sample_identity() = reply_identity(info);
    // A reply written before the client's reader is known never reaches it. A client that left
    // does not match any more; its answer goes to nobody.
    const auto& readers = replies_.readers();
    const auto& client = params.related_sample_identity().writer_guid();
    const bool found = names_reply_reader(info)
                           ? readers.wait_for(client, reply_match_timeout)
                           : readers.wait_for_peer(client, reply_match_timeout);
    if (found) static_cast<void>(replies_.write(answer, params));
  }

  std::function<Reply(const Request&)> answer_;
  Writer<Reply> replies_;
  Reader<Request> requests_;
  // Last: stops before what it uses is gone.
  std::jthread thread_;
};

}  // namespace stillmap
