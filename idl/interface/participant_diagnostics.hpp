#pragma once

#include <vector>

#include "idl/dds/endpoint_match.hpp"
#include "idl/interface/diagnostic.hpp"

namespace stillmap {

/// A writer and a reader that do not find together, in words.
[[nodiscard]] Finding finding_of(const Mismatch& mismatch);

/// Every pair of ends that does not fit, each kind of obstacle between two peers once.
[[nodiscard]] std::vector<Finding> mismatch_findings(const std::vector<Mismatch>& mismatches);

/// Who cannot talk to `self` for reasons of DDS Security: secured on one side only, or refused.
[[nodiscard]] std::vector<Finding> security_findings(const Peer& self,
                                                     const std::vector<Peer>& peers);

/// Peers on this machine that are there, but none of whose topics arrive: their shared memory is
/// not ours. Discovery must have had a few seconds.
[[nodiscard]] std::vector<Finding> silent_peer_findings(const Peer& self,
                                                        const std::vector<Peer>& peers);

}  // namespace stillmap
