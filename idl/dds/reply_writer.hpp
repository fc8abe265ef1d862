#pragma once

#include <chrono>
#include <deque>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "idl/dds/service_identity.hpp"

namespace eprosima::fastrtps::rtps {
class RTPSWriter;
}

namespace stillmap::dds {

/// Writes the replies of a service, each to the process that asked and to no other, and knows which
/// of them their clients have not acknowledged yet: a client that is stopped keeps its replies in
/// memory until DDS gives it up. One thread uses it.
class ReplyWriter {
 public:
  using Clock = std::chrono::steady_clock;
  using GuidPrefix = eprosima::fastrtps::rtps::GuidPrefix_t;

  /// Bytes of replies that are kept for repairs, of all clients together.
  static constexpr std::size_t max_held_bytes = 64U << 20U;

  /// Throws DdsError.
  ReplyWriter(Participant& participant, const std::string& service, const std::string& type_name);
  ~ReplyWriter();
  ReplyWriter(const ReplyWriter&) = delete;
  ReplyWriter& operator=(const ReplyWriter&) = delete;

  [[nodiscard]] const MatchedReaders& readers() const { return writer_.readers(); }

  /// Makes room for a reply of so many bytes. Gives up replies that wait for their clients for so
  /// long that others must not wait for them any more; returns their calls.
  [[nodiscard]] std::vector<ServiceCall> make_room(std::size_t bytes, Clock::time_point now);
  [[nodiscard]] bool has_room(std::size_t bytes) const;

  /// False when it was not written.
  [[nodiscard]] bool write(const ServiceCall& call, const SerializedSample& reply,
                           Clock::time_point now);

  /// True when the process has not taken so many bytes of its replies for long, or at all where the
  /// rate is limited, or when some of them were given up and it has taken none since.
  [[nodiscard]] bool is_slow(const GuidPrefix& client, std::size_t max_bytes,
                             Clock::time_point now);

  /// Tells all readers, now, which reply is the next. Fast DDS itself says so to a new reader once,
  /// often before that knows the writer, and then no more until there is a reply.
  void send_heartbeat();

 private:
  class ToAskingProcess;
  struct Held {
    eprosima::fastrtps::rtps::SequenceNumber_t number;
    ServiceCall call;
    std::size_t bytes = 0;
    Clock::time_point written;
  };

  [[nodiscard]] bool is_acknowledged(const Held& reply) const;
  /// How long a reply may be on its way.
  [[nodiscard]] std::chrono::duration<double> patience() const;
  /// Releases the oldest reply, acknowledged or not.
  void release_oldest();

  /// Bytes per second that large messages may take; 0: no limit.
  std::uint32_t rate_bytes_per_s_;
  std::unique_ptr<ToAskingProcess> filter_;
  SerializedSampleWriter writer_;
  eprosima::fastrtps::rtps::RTPSWriter* rtps_writer_;
  std::deque<Held> held_;
  std::size_t held_bytes_ = 0;
  /// Whose replies were given up.
  std::set<GuidPrefix> given_up_;
};

}  // namespace stillmap::dds
