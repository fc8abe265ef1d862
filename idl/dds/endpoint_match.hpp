#pragma once

#include <string>
#include <vector>

#include "idl/dds/remote_participant.hpp"

namespace stillmap {

/// What keeps a writer and a reader of one topic apart, a policy a line, such as "reliability: the
/// writer offers best effort, the reader wants reliable"; empty when they fit. By the rules of the
/// DDS specification (2.2.3).
[[nodiscard]] std::vector<std::string> obstacles(const Endpoint& writer, const Endpoint& reader);

/// A writer and a reader of one topic that do not find together.
struct Mismatch {
  std::string topic;
  Endpoint writer;
  Endpoint reader;
  /// Whose they are.
  Peer writer_peer;
  Peer reader_peer;
  std::vector<std::string> obstacles;
};

/// Every writer and reader of different participants on the same topic that do not fit.
[[nodiscard]] std::vector<Mismatch> mismatches(const std::vector<Peer>& participants);

}  // namespace stillmap
