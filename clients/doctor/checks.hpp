#pragma once

#include <vector>

#include "clients/doctor/system_snapshot.hpp"
#include "idl/interface/diagnostic.hpp"

namespace stillmap {

using Findings = std::vector<Finding>;

// Each looks for one kind of trouble and knows nothing of the others.

/// /dev/shm that cannot be written, segments of dead processes and of other users.
[[nodiscard]] Findings check_shared_memory(const Evidence& evidence);
/// UDP buffers too small for a scan.
[[nodiscard]] Findings check_socket_buffers(const Evidence& evidence);
/// Interfaces and routes that carry no multicast, by which peers find each other.
[[nodiscard]] Findings check_multicast(const Evidence& evidence);
/// Nobody in this domain, and who is in others.
[[nodiscard]] Findings check_domain(const Evidence& evidence);
/// Secured on one side only, or refused.
[[nodiscard]] Findings check_security(const Evidence& evidence);
/// Peers that are seen, but none of their topics.
[[nodiscard]] Findings check_silent_peers(const Evidence& evidence);
/// No server, one that does not answer, several of one name, another version.
[[nodiscard]] Findings check_servers(const Evidence& evidence);
/// Writers and readers of one topic that do not fit, of any two peers.
[[nodiscard]] Findings check_endpoints(const Evidence& evidence);
/// No scans, and because of what; scans that are dropped.
[[nodiscard]] Findings check_scans(const Evidence& evidence);
/// Clouds without a frame, or with one that tf does not know.
[[nodiscard]] Findings check_frames(const Evidence& evidence);
/// Clocks that differ between this machine, the server's and the sensor's.
[[nodiscard]] Findings check_clocks(const Evidence& evidence);
/// What the server itself found.
[[nodiscard]] Findings check_server_findings(const Evidence& evidence);

/// All of them, causes before their effects; what two of them say is there once.
[[nodiscard]] Findings diagnose(const Evidence& evidence);

}  // namespace stillmap
