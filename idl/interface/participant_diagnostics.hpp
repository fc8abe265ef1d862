#pragma once

#include <vector>

#include "idl/dds/endpoint_match.hpp"
#include "idl/interface/diagnostic.hpp"

namespace stillmap::dds {

/// A writer and a reader that do not find together, in words.
[[nodiscard]] Diagnostic to_diagnostic(const Mismatch& mismatch);

/// Every pair of ends that does not fit, each kind of obstacle between two peers once.
[[nodiscard]] std::vector<Diagnostic> mismatch_diagnostics(const std::vector<Mismatch>& mismatches);

/// Who cannot talk to `self` for reasons of DDS Security: secured on one side only, or refused.
[[nodiscard]] std::vector<Diagnostic> security_diagnostics(
    const RemoteParticipant& self, const std::vector<RemoteParticipant>& peers);

/// Peers on this machine that are there, but none of whose topics arrive: their shared memory is
/// not ours. Discovery must have had a few seconds.
[[nodiscard]] std::vector<Diagnostic> silent_participant_diagnostics(
    const RemoteParticipant& self, const std::vector<RemoteParticipant>& peers);

}  // namespace stillmap::dds
