#pragma once

#include <vector>

#include "clients/doctor/system_snapshot.hpp"
#include "idl/interface/diagnostic.hpp"

namespace stillmap::cli {

using Diagnostics = std::vector<dds::Diagnostic>;

/// The DDS type of scans.
inline constexpr const char* cloud_type = "sensor_msgs::msg::dds_::PointCloud2_";

// Each check looks for one kind of fault, independently of the others.

/// /dev/shm that cannot be written, segments of dead processes and of other users.
[[nodiscard]] Diagnostics check_shared_memory(const SystemSnapshot& snapshot);
/// UDP buffers too small for a scan.
[[nodiscard]] Diagnostics check_socket_buffers(const SystemSnapshot& snapshot);
/// Interfaces and routes that carry no multicast, by which participants find each other.
[[nodiscard]] Diagnostics check_multicast(const SystemSnapshot& snapshot);
/// An empty domain, and who is in others.
[[nodiscard]] Diagnostics check_domain(const SystemSnapshot& snapshot);
/// Secured on one side only, refused, or not authenticated.
[[nodiscard]] Diagnostics check_security(const SystemSnapshot& snapshot);
/// Participants that are discovered, but none of their endpoints.
[[nodiscard]] Diagnostics check_silent_participants(const SystemSnapshot& snapshot);
/// No server, one that does not answer, several of one name, another version.
[[nodiscard]] Diagnostics check_servers(const SystemSnapshot& snapshot);
/// Writers and readers of one topic that do not fit, of any two participants.
[[nodiscard]] Diagnostics check_endpoints(const SystemSnapshot& snapshot);
/// No scans, and why; scans that are dropped.
[[nodiscard]] Diagnostics check_scans(const SystemSnapshot& snapshot);
/// Clouds without a frame, or with one that tf does not know.
[[nodiscard]] Diagnostics check_frames(const SystemSnapshot& snapshot);
/// Clocks that differ between this machine, the server's and the sensor's.
[[nodiscard]] Diagnostics check_clocks(const SystemSnapshot& snapshot);
/// Diagnostics of the server itself.
[[nodiscard]] Diagnostics check_server_diagnostics(const SystemSnapshot& snapshot);

/// All checks, errors first, causes before their effects, without duplicates.
[[nodiscard]] Diagnostics diagnose(const SystemSnapshot& snapshot);

}  // namespace stillmap::cli
