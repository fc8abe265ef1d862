#include <algorithm>
#include <numeric>

#include "clients/doctor/checks.hpp"

namespace stillmap::cli {
namespace {

// A cloud of 120,000 points with intensity, ring and time.
constexpr std::uint32_t scan_bytes = 4U << 20U;

// UDP is what reaches participants without shared memory of ours.
bool needs_udp(const SystemSnapshot& snapshot) {
  return std::ranges::any_of(snapshot.participants, [&](const dds::RemoteParticipant& participant) {
    return !participant.is_on_this_host || !snapshot.dds.shared_memory;
  });
}

std::string mebibytes(std::uint64_t bytes) { return std::to_string(bytes >> 20U) + " MiB"; }

std::uint64_t bytes_of(const std::vector<dds::SharedMemorySegment>& segments) {
  return std::accumulate(segments.begin(), segments.end(), std::uint64_t{0},
                         [](std::uint64_t sum, const dds::SharedMemorySegment& segment) {
                           return sum + segment.bytes;
                         });
}

dds::Diagnostic stale_segments_diagnostic(const std::vector<dds::SharedMemorySegment>& stale) {
  return {.severity = dds::Severity::advice,
          .what = std::to_string(stale.size()) + " shared memory segments of dead processes",
          .evidence = mebibytes(bytes_of(stale)) +
                      " in /dev/shm that no living process holds, as " + stale.front().name,
          .hint = "stillmap doctor --clean"};
}

dds::Diagnostic foreign_segments_diagnostic(const std::vector<dds::SharedMemorySegment>& foreign,
                                            std::uint32_t user) {
  return {.severity = dds::Severity::advice,
          .what = "other users run DDS on this machine",
          .evidence = std::to_string(foreign.size()) + " segments in /dev/shm, as " +
                      foreign.front().name + ", belong to user " +
                      std::to_string(foreign.front().owner) + ", and we are user " +
                      std::to_string(user),
          .hint =
              "to talk to them, switch shared memory off on both sides (--udp-only; "
              "dds.shared_memory: false) or run both as one user"};
}

}  // namespace

Diagnostics check_shared_memory(const SystemSnapshot& snapshot) {
  Diagnostics diagnostics;
  if (!snapshot.dds.shared_memory) return diagnostics;
  const HostFacts& host = snapshot.host;
  if (!host.shared_memory_fault.empty()) {
    diagnostics.push_back({.severity = dds::Severity::problem,
                           .what = "shared memory cannot be used",
                           .evidence = host.shared_memory_fault,
                           .hint = "sudo chmod 1777 /dev/shm (in a container: mount a tmpfs "
                                   "there), or use --udp-only and dds.shared_memory: false"});
  }
  std::vector<dds::SharedMemorySegment> stale, foreign;
  for (const dds::SharedMemorySegment& segment : host.segments) {
    if (segment.is_stale) {
      stale.push_back(segment);
    } else if (segment.owner != host.user) {
      foreign.push_back(segment);
    }
  }
  if (!stale.empty()) diagnostics.push_back(stale_segments_diagnostic(stale));
  if (!foreign.empty()) diagnostics.push_back(foreign_segments_diagnostic(foreign, host.user));
  return diagnostics;
}

Diagnostics check_socket_buffers(const SystemSnapshot& snapshot) {
  const std::uint32_t largest =
      std::min(snapshot.host.max_receive_buffer_bytes.value_or(snapshot.granted_buffer_bytes),
               snapshot.granted_buffer_bytes);
  const std::uint32_t wanted = std::max(scan_bytes, snapshot.dds.socket_buffer_bytes);
  if (largest >= wanted) return {};
  return {{.severity = needs_udp(snapshot) ? dds::Severity::problem : dds::Severity::advice,
           .what = "UDP buffers are too small for a scan",
           .evidence = "net.core.rmem_max gives " + std::to_string(largest) +
                       " bytes; a scan has up "
                       "to " +
                       std::to_string(scan_bytes) +
                       ", and fragments that do not fit are "
                       "lost",
           .hint = "sudo sysctl net.core.rmem_max=" + std::to_string(wanted) +
                   " (for good: a line in /etc/sysctl.d/60-stillmap.conf), on both machines"}};
}

Diagnostics check_multicast(const SystemSnapshot& snapshot) {
  Diagnostics diagnostics;
  std::string without, with;
  for (const NetworkInterface& interface : snapshot.host.interfaces) {
    if (!interface.is_up || interface.is_loopback) continue;
    std::string& list = interface.has_multicast ? with : without;
    list.append(list.empty() ? "" : ", ").append(interface.name);
  }
  if (with.empty()) {
    diagnostics.push_back({.severity = dds::Severity::advice,
                           .what = "only participants on this machine can be found",
                           .evidence = without.empty()
                                           ? "no network interface but the loopback is up"
                                           : without + " carries no multicast",
                           .hint = "bring a network up, or take a DDS profile without multicast "
                                   "that names the peers"});
  } else if (!snapshot.host.has_multicast_route) {
    diagnostics.push_back({.severity = dds::Severity::advice,
                           .what = "multicast has no route, and participants find each other by it",
                           .evidence = "no route of /proc/net/route takes 239.255.0.1",
                           .hint = "sudo ip route add 239.255.0.0/16 dev " + with});
  }
  return diagnostics;
}

}  // namespace stillmap::cli
