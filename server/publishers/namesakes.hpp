#pragma once

#include <chrono>
#include <map>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "idl/dds/participant.hpp"
#include "idl/dds/service_client.hpp"
#include "server/threads/periodic_worker.hpp"
#include "stillmap_msgs.h"

namespace stillmap::server {

/// Which of the servers that discovery knows by a name are there: one that was killed is known
/// until its lease ends, and a discovery server tells of it those who come meanwhile.
class NamesakeRecord {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  /// After so many questions in vain, one is there no more until it answers.
  static constexpr int max_vain_questions = 3;

  /// How long one that has not answered yet may be one of the dead; 0 where nobody tells of those.
  explicit NamesakeRecord(std::chrono::nanoseconds patience) : patience_(patience) {}

  /// Those of `known`, all that discovery knows now, that are there.
  [[nodiscard]] std::vector<dds::RemoteParticipant> there(std::vector<dds::RemoteParticipant> known,
                                                          TimePoint now);
  /// The guids of all that discovery knew last: who is asked next.
  [[nodiscard]] std::vector<std::string> known() const;
  /// A question to `asked` was answered by `answered` (guids).
  void add_answers(const std::vector<std::string>& asked, const std::vector<std::string>& answered);

 private:
  struct Known {
    TimePoint since;
    bool has_answered = false;
    int vain_questions = 0;
  };

  std::chrono::nanoseconds patience_;
  /// By guid.
  std::map<std::string, Known> known_;
};

/// Other servers of this one's name that are there. While discovery knows any, they are asked for
/// their status once a second; where security forbids that, those count that discovery knows, and
/// a discovery server tells of none. Thread-safe.
class Namesakes {
 public:
  /// `name_space`: of the server's topics, by which clients call it.
  Namesakes(dds::Participant& participant, std::string name_space);

  /// Those among the other participants of the domain. Who is asked is who was among them last.
  [[nodiscard]] std::vector<dds::RemoteParticipant> among(
      const std::vector<dds::RemoteParticipant>& peers);

 private:
  void ask(const std::stop_token& stop);
  void make_client();

  dds::Participant& participant_;
  const std::string name_space_;
  const bool is_told_by_discovery_server_;
  std::mutex mutex_;
  NamesakeRecord record_;
  /// Made when there is somebody to ask; where a discovery server is to tell of them, at once: it
  /// tells of nobody who has nothing for us. Of the worker's thread.
  std::optional<dds::ServiceClient<stillmap_msgs::srv::GetStatus_Request,
                                   stillmap_msgs::srv::GetStatus_Response>>
      client_;
  // Last: stops before what it uses is gone.
  PeriodicWorker worker_;
};

}  // namespace stillmap::server
