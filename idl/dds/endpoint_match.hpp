#pragma once

#include <string>
#include <vector>

#include "idl/dds/remote_participant.hpp"

namespace stillmap::dds {

/// Which policies keep a writer and a reader of one topic from matching, one a line, such as
/// "reliability: the writer offers best effort, the reader wants reliable"; empty when they fit. By
/// the rules of the DDS specification (2.2.3).
[[nodiscard]] std::vector<std::string> incompatible_policies(const Endpoint& writer,
                                                             const Endpoint& reader);

/// A writer and a reader of one topic that do not match.
struct Mismatch {
  std::string topic;
  Endpoint writer;
  Endpoint reader;
  /// Whose they are.
  RemoteParticipant writer_participant;
  RemoteParticipant reader_participant;
  std::vector<std::string> incompatible_policies;
};

/// Every writer and reader of different participants on the same topic that do not match, unless
/// another reader of the same participant does.
[[nodiscard]] std::vector<Mismatch> mismatches(const std::vector<RemoteParticipant>& participants);

}  // namespace stillmap::dds
