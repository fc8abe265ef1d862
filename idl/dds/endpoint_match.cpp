#include "idl/dds/endpoint_match.hpp"

#include <fnmatch.h>

#include <algorithm>
#include <map>
#include <set>
#include <string_view>
#include <tuple>
#include <utility>

namespace stillmap::dds {
namespace {

using Reasons = std::vector<std::string>;

std::string offer(const std::string& policy, std::string_view offered, std::string_view wanted) {
  std::string text = policy;
  return text.append(": the writer offers ")
      .append(offered)
      .append(", the reader wants ")
      .append(wanted);
}

// A span that may be endless, in words.
std::string span(const std::optional<std::chrono::nanoseconds>& time) {
  if (!time) return "none";
  return std::to_string(std::chrono::duration_cast<std::chrono::milliseconds>(*time).count()) +
         " ms";
}

bool is_longer(const std::optional<std::chrono::nanoseconds>& offered,
               const std::optional<std::chrono::nanoseconds>& wanted) {
  return wanted && (!offered || *offered > *wanted);
}

void compare_types(const Endpoint& writer, const Endpoint& reader, Reasons& reasons) {
  if (writer.type != reader.type) {
    reasons.push_back("type: the writer has " + writer.type + ", the reader " + reader.type);
  } else if (writer.is_keyed != reader.is_keyed) {
    reasons.emplace_back(writer.is_keyed
                             ? "keys: the writer's type has keys, the reader's has none"
                             : "keys: the reader's type has keys, the writer's has none");
  }
}

void compare_reliability_and_durability(const EndpointQos& writer, const EndpointQos& reader,
                                        Reasons& reasons) {
  if (reader.reliable && !writer.reliable) {
    reasons.push_back(offer("reliability", "best effort", "reliable"));
  }
  if (writer.durability < reader.durability) {
    reasons.push_back(offer("durability", name(writer.durability), name(reader.durability)));
  }
}

void compare_times(const EndpointQos& writer, const EndpointQos& reader, Reasons& reasons) {
  if (is_longer(writer.deadline, reader.deadline)) {
    reasons.push_back(offer("deadline", span(writer.deadline), span(reader.deadline)));
  }
  if (writer.liveliness_kind < reader.liveliness_kind) {
    reasons.push_back(offer("liveliness", "a weaker kind", "a stronger one"));
  }
  if (is_longer(writer.liveliness_lease, reader.liveliness_lease)) {
    reasons.push_back(
        offer("liveliness lease", span(writer.liveliness_lease), span(reader.liveliness_lease)));
  }
}

Reasons or_unnamed(const Reasons& partitions) {
  return partitions.empty() ? Reasons{""} : partitions;
}

bool share_partition(const EndpointQos& writer, const EndpointQos& reader) {
  for (const std::string& ours : or_unnamed(writer.partitions)) {
    for (const std::string& theirs : or_unnamed(reader.partitions)) {
      if (ours == theirs || ::fnmatch(ours.c_str(), theirs.c_str(), 0) == 0 ||
          ::fnmatch(theirs.c_str(), ours.c_str(), 0) == 0) {
        return true;
      }
    }
  }
  return false;
}

std::string in_quotes(const Reasons& partitions) {
  std::string text;
  for (const std::string& partition : or_unnamed(partitions)) {
    text += (text.empty() ? "'" : ", '") + partition + "'";
  }
  return text;
}

}  // namespace

std::vector<std::string> incompatible_policies(const Endpoint& writer, const Endpoint& reader) {
  Reasons reasons;
  compare_types(writer, reader, reasons);
  compare_reliability_and_durability(writer.qos, reader.qos, reasons);
  compare_times(writer.qos, reader.qos, reasons);
  if (writer.qos.exclusive_ownership != reader.qos.exclusive_ownership) {
    reasons.push_back(writer.qos.exclusive_ownership ? offer("ownership", "exclusive", "shared")
                                                     : offer("ownership", "shared", "exclusive"));
  }
  if (!share_partition(writer.qos, reader.qos)) {
    reasons.push_back("partition: the writer is in " + in_quotes(writer.qos.partitions) +
                      ", the reader in " + in_quotes(reader.qos.partitions));
  }
  return reasons;
}

namespace {

struct ByWhatMatches {
  bool operator()(const Endpoint* one, const Endpoint* other) const {
    return std::tie(one->type, one->is_keyed, one->qos) <
           std::tie(other->type, other->is_keyed, other->qos);
  }
};

/// Endpoints of one participant on one topic; of those that are alike, one: a process may have
/// hundreds.
using Ends = std::set<const Endpoint*, ByWhatMatches>;
using EndsOfEach = std::map<const RemoteParticipant*, Ends>;

struct OnTopic {
  EndsOfEach writers;
  EndsOfEach readers;
};

void add_endpoints(const RemoteParticipant& participant,
                   std::map<std::string_view, OnTopic>& topics) {
  for (const Endpoint& endpoint : participant.endpoints) {
    OnTopic& topic = topics[endpoint.topic];
    (endpoint.is_writer ? topic.writers : topic.readers)[&participant].insert(&endpoint);
  }
}

/// What keeps each of these writers from these readers; a writer that one of them gets is none.
std::set<Reasons> reasons_between(const Ends& writers, const Ends& readers) {
  std::set<Reasons> all;
  for (const Endpoint* writer : writers) {
    std::set<Reasons> of_writer;
    // One of two readers is enough: a reliable one, and one for best-effort writers.
    const bool reaches = std::ranges::any_of(readers, [&](const Endpoint* reader) {
      auto reasons = incompatible_policies(*writer, *reader);
      if (reasons.empty()) return true;
      of_writer.insert(std::move(reasons));
      return false;
    });
    if (!reaches) all.merge(of_writer);
  }
  return all;
}

/// `self`: of whom one side must be; null: of anybody.
void compare(std::string_view name, const OnTopic& topic, const RemoteParticipant* self,
             Mismatches& mismatches) {
  for (const auto& [writing, writers] : topic.writers) {
    for (const auto& [reading, readers] : topic.readers) {
      if (writing == reading) continue;
      if (self != nullptr && writing != self && reading != self) continue;
      for (const Reasons& reasons : reasons_between(writers, readers)) {
        if (mismatches.found.size() == max_mismatches) {
          ++mismatches.left_out;
          continue;
        }
        mismatches.found.push_back({.topic = std::string(name),
                                    .writer_participant = writing,
                                    .reader_participant = reading,
                                    .incompatible_policies = reasons});
      }
    }
  }
}

Mismatches compare(const std::map<std::string_view, OnTopic>& topics,
                   const RemoteParticipant* self) {
  Mismatches mismatches;
  for (const auto& [name, topic] : topics) compare(name, topic, self, mismatches);
  return mismatches;
}

}  // namespace

Mismatches mismatches(const std::vector<RemoteParticipant>& participants) {
  std::map<std::string_view, OnTopic> topics;
  for (const RemoteParticipant& participant : participants) add_endpoints(participant, topics);
  return compare(topics, nullptr);
}

Mismatches mismatches_of(const RemoteParticipant& self,
                         const std::vector<RemoteParticipant>& peers) {
  std::map<std::string_view, OnTopic> topics;
  add_endpoints(self, topics);
  for (const RemoteParticipant& peer : peers) add_endpoints(peer, topics);
  return compare(topics, &self);
}

}  // namespace stillmap::dds
