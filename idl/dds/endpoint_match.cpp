#include "idl/dds/endpoint_match.hpp"

#include <fnmatch.h>

#include <algorithm>
#include <map>
#include <string_view>

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

/// Whether some endpoint of the participant matches this one.
bool reaches(const RemoteParticipant& participant, const Endpoint& endpoint) {
  return std::ranges::any_of(participant.endpoints, [&](const Endpoint& other) {
    if (other.is_writer == endpoint.is_writer || other.topic != endpoint.topic) return false;
    return (endpoint.is_writer ? incompatible_policies(endpoint, other)
                               : incompatible_policies(other, endpoint))
        .empty();
  });
}

}  // namespace

std::vector<Mismatch> mismatches(const std::vector<RemoteParticipant>& participants) {
  struct Match {
    const RemoteParticipant* peer;
    const Endpoint* endpoint;
  };
  std::multimap<std::string, Match> readers;
  for (const RemoteParticipant& peer : participants) {
    for (const Endpoint& endpoint : peer.endpoints) {
      if (!endpoint.is_writer) readers.emplace(endpoint.topic, Match{&peer, &endpoint});
    }
  }
  std::vector<Mismatch> found;
  for (const RemoteParticipant& peer : participants) {
    for (const Endpoint& writer : peer.endpoints) {
      if (!writer.is_writer) continue;
      const auto [begin, end] = readers.equal_range(writer.topic);
      for (auto it = begin; it != end; ++it) {
        const Match& reader = it->second;
        if (reader.peer == &peer) continue;
        auto reasons = incompatible_policies(writer, *reader.endpoint);
        // One of two readers is enough: a reliable one, and one for best-effort writers.
        if (reasons.empty() || reaches(*reader.peer, writer)) continue;
        found.push_back({.topic = writer.topic,
                         .writer = writer,
                         .reader = *reader.endpoint,
                         .writer_participant = peer,
                         .reader_participant = *reader.peer,
                         .incompatible_policies = std::move(reasons)});
      }
    }
  }
  return found;
}

}  // namespace stillmap::dds
