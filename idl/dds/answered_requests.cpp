#include "idl/dds/answered_requests.hpp"

#include <algorithm>
#include <utility>

namespace stillmap::dds {

const SerializedSample* AnsweredRequests::find(const RequestId& id, Clock::time_point now) const {
  const auto found = std::ranges::find(answers_, id, &Answer::id);
  return found == answers_.end() || now - found->given > max_age ? nullptr : &found->reply;
}

void AnsweredRequests::add(const RequestId& id, SerializedSample reply, Clock::time_point now) {
  bytes_ += reply.size();
  answers_.push_back({.id = id, .reply = std::move(reply), .given = now});
  while (!answers_.empty() && (answers_.size() > max_count || bytes_ > max_bytes ||
                               now - answers_.front().given > max_age)) {
    bytes_ -= answers_.front().reply.size();
    answers_.pop_front();
  }
}

}  // namespace stillmap::dds
