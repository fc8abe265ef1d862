#pragma once

#include <string>
#include <vector>

#include "idl/dds/endpoint_match.hpp"
#include "idl/interface/diagnostic.hpp"

namespace stillmap::dds {

/// Name of a participant that looks into a domain for a moment, as the doctor does into all that it
/// finds: without endpoints, and without an identity in secured ones. No diagnostic is about it.
inline constexpr const char* survey_participant = "stillmap_survey";

/// Of a writer and a reader that do not match.
[[nodiscard]] Diagnostic to_diagnostic(const Mismatch& mismatch);

/// Of each that was found, those once that say the same; and how many more there are.
[[nodiscard]] std::vector<Diagnostic> mismatch_diagnostics(const Mismatches& mismatches);

/// Of participants that DDS Security keeps from `self`: secured on one side only, refused, or not
/// authenticated for no reason that this side knows.
[[nodiscard]] std::vector<Diagnostic> security_diagnostics(
    const RemoteParticipant& self, const std::vector<RemoteParticipant>& peers);

/// Of participants without endpoints: their announcements do not arrive, as between containers with
/// separate shared memory. Discovery must have had a few seconds.
[[nodiscard]] std::vector<Diagnostic> silent_participant_diagnostics(
    const RemoteParticipant& self, const std::vector<RemoteParticipant>& peers);

/// The peers that answer as the server whose topics lie in `name_space`.
[[nodiscard]] std::vector<RemoteParticipant> servers_called(
    const std::string& name_space, const std::vector<RemoteParticipant>& peers);

/// One for each of `namesakes`: other servers that are called `name_space`, as ours is.
[[nodiscard]] std::vector<Diagnostic> namesake_diagnostics(
    const std::string& name_space, const std::vector<RemoteParticipant>& namesakes);

/// Whether the diagnostic is one of those.
[[nodiscard]] bool is_of_namesake(const Diagnostic& diagnostic);

/// How many scans of a publisher arrived lately, and how many did not.
struct ScanLosses {
  /// Of the publisher, as in Endpoint.
  std::string writer_guid;
  std::uint64_t received = 0;
  std::uint64_t lost = 0;
};

/// Why scans on `topic` (its DDS name) get lost on the way to `self`, and what would help.
[[nodiscard]] Diagnostic lost_scans_diagnostic(const std::string& topic, const ScanLosses& losses,
                                               const RemoteParticipant& self,
                                               const std::vector<RemoteParticipant>& peers);

/// Of the writers that send scans on `topic` (its DDS name) in turns, where one lidar is expected.
[[nodiscard]] Diagnostic several_publishers_diagnostic(const std::string& topic,
                                                       const std::vector<std::string>& writer_guids,
                                                       const std::vector<RemoteParticipant>& peers);

}  // namespace stillmap::dds
