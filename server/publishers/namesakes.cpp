#include "server/publishers/namesakes.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "idl/dds/dds_error.hpp"
#include "idl/dds/discovery.hpp"
#include "idl/interface/participant_diagnostics.hpp"
#include "idl/interface/services.hpp"
#include "idl/interface/topics.hpp"

namespace stillmap::server {
namespace {

using namespace std::chrono_literals;

constexpr std::chrono::duration<double> question_period{1.0};
constexpr auto longest_answer = 1000ms;

/// Of a participant that a discovery server tells of: it forgets it, too.
std::chrono::nanoseconds patience_with(const dds::DdsOptions& options) {
  if (!dds::is_told_by_discovery_server(options)) return 0s;
  return std::chrono::seconds(options.lease_s + 2);
}

}  // namespace

std::vector<dds::RemoteParticipant> NamesakeRecord::there(std::vector<dds::RemoteParticipant> known,
                                                          TimePoint now) {
  std::erase_if(known_, [&](const auto& one) {
    return std::ranges::find(known, one.first, &dds::RemoteParticipant::guid) == known.end();
  });
  std::erase_if(known, [&](const dds::RemoteParticipant& server) {
    const Known& one = known_.try_emplace(server.guid, Known{.since = now}).first->second;
    if (one.vain_questions >= max_vain_questions) return true;
    return !one.has_answered && now - one.since < patience_;
  });
  return known;
}

std::vector<std::string> NamesakeRecord::known() const {
  std::vector<std::string> guids;
  for (const auto& [guid, one] : known_) guids.push_back(guid);
  return guids;
}

void NamesakeRecord::add_answers(const std::vector<std::string>& asked,
                                 const std::vector<std::string>& answered) {
  const auto is_among = [](const std::vector<std::string>& guids, const std::string& guid) {
    return std::ranges::find(guids, guid) != guids.end();
  };
  for (auto& [guid, one] : known_) {
    if (is_among(answered, guid)) {
      one.has_answered = true;
      one.vain_questions = 0;
    } else if (is_among(asked, guid)) {
      ++one.vain_questions;
    }
  }
}

Namesakes::Namesakes(dds::Participant& participant, std::string name_space)
    : participant_(participant),
      name_space_(std::move(name_space)),
      is_told_by_discovery_server_(dds::is_told_by_discovery_server(participant.options())),
      record_(patience_with(participant.options())),
      worker_("namesakes", question_period, [this](const std::stop_token& stop) { ask(stop); }) {}

std::vector<dds::RemoteParticipant> Namesakes::among(
    const std::vector<dds::RemoteParticipant>& peers) {
  const std::scoped_lock lock(mutex_);
  return record_.there(dds::servers_called(name_space_, peers),
                       NamesakeRecord::TimePoint::clock::now());
}

void Namesakes::make_client() {
  try {
    client_.emplace(participant_, dds::services::get_status.in(name_space_));
  } catch (const dds::DdsError& fault) {
    spdlog::debug("servers of the same name cannot be asked: {}", fault.what());
  }
}

void Namesakes::ask(const std::stop_token& stop) {
  const std::vector<std::string> asked = [&] {
    const std::scoped_lock lock(mutex_);
    return record_.known();
  }();
  if (asked.empty() && !is_told_by_discovery_server_) return client_.reset();
  // Found by the others until the next round.
  if (!client_) return make_client();
  if (asked.empty() || !client_->refusal().empty()) return;
  stillmap_msgs::srv::GetStatus_Request question;
  question.format_version(dds::wire_format_version);
  const auto answered = client_->who_answers(question, longest_answer, stop);
  const std::scoped_lock lock(mutex_);
  if (answered) record_.add_answers(asked, *answered);
}

}  // namespace stillmap::server
