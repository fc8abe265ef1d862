#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "idl/dds/remote_participant.hpp"

namespace stillmap::dds {

/// Which policies keep a writer and a reader of one topic from matching, one a line, such as
/// "reliability: the writer offers best effort, the reader wants reliable"; empty when they fit. By
/// the rules of the DDS specification (2.2.3).
[[nodiscard]] std::vector<std::string> incompatible_policies(const Endpoint& writer,
                                                             const Endpoint& reader);

/// Writers of one participant and readers of another one, on one topic, that do not match.
struct Mismatch {
  std::string topic;
  /// Whose they are; among the participants that were compared.
  const RemoteParticipant* writer_participant = nullptr;
  const RemoteParticipant* reader_participant = nullptr;
  std::vector<std::string> incompatible_policies;
};

/// However many endpoints a domain has, so many of them are named.
inline constexpr std::size_t max_mismatches = 50;

struct Mismatches {
  /// `max_mismatches` at most.
  std::vector<Mismatch> found;
  /// How many more there are.
  std::size_t left_out = 0;
};

/// Where writers and readers of different participants on the same topic do not match, unless
/// another reader of the same participant does: once for two participants, a topic and what keeps
/// them apart. The participants must outlive the result.
[[nodiscard]] Mismatches mismatches(const std::vector<RemoteParticipant>& participants);

/// The same, only between `self` and each of its peers.
[[nodiscard]] Mismatches mismatches_of(const RemoteParticipant& self,
                                       const std::vector<RemoteParticipant>& peers);

}  // namespace stillmap::dds
