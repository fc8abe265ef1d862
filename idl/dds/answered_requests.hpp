#pragma once

#include <chrono>
#include <deque>

#include "idl/dds/service_identity.hpp"

namespace stillmap::dds {

/// The newest replies of a service, so that a call that comes again is answered again and not
/// carried out again. One thread uses it.
class AnsweredRequests {
 public:
  using Clock = std::chrono::steady_clock;

  /// Beyond them, the oldest go.
  static constexpr std::size_t max_count = 1000;
  static constexpr std::size_t max_bytes = 4U << 20U;
  /// Longer than a client waits for an answer.
  static constexpr std::chrono::minutes max_age{10};

  /// The reply to this call; null when it has not been answered, or too long ago.
  [[nodiscard]] const SerializedSample* find(const RequestId& id, Clock::time_point now) const;

  void add(const RequestId& id, SerializedSample reply, Clock::time_point now);

  [[nodiscard]] std::size_t count() const { return answers_.size(); }

 private:
  struct Answer {
    RequestId id;
    SerializedSample reply;
    Clock::time_point given;
  };

  std::deque<Answer> answers_;
  std::size_t bytes_ = 0;
};

}  // namespace stillmap::dds
