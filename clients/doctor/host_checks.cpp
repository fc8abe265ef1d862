#include <algorithm>
#include <numeric>

#include "clients/doctor/checks.hpp"

namespace stillmap {
namespace {

// A cloud of 120,000 points with intensity, ring and time.
constexpr std::uint32_t scan_bytes = 4U << 20U;

// UDP is what reaches peers without shared memory of ours.
bool needs_udp(const Evidence& evidence) {
  return std::ranges::any_of(evidence.peers, [&](const Peer& peer) {
    return !peer.is_on_this_host || !evidence.dds.shared_memory;
  });
}

std::string mebibytes(std::uint64_t bytes) { return std::to_string(bytes >> 20U) + " MiB"; }

std::uint64_t bytes_of(const std::vector<SharedSegment>& segments) {
  return std::accumulate(
      segments.begin(), segments.end(), std::uint64_t{0},
      [](std::uint64_t sum, const SharedSegment& segment) { return sum + segment.bytes; });
}

Finding stale_finding(const std::vector<SharedSegment>& stale) {
  return {.severity = Severity::advice,
          .what = std::to_string(stale.size()) + " shared memory segments of dead processes",
          .evidence = mebibytes(bytes_of(stale)) +
                      " in /dev/shm that no living process holds, as " + stale.front().name,
          .way_out = "stillmap doctor --clean"};
}

Finding foreign_finding(const std::vector<SharedSegment>& foreign, std::uint32_t user) {
  return {.severity = Severity::advice,
          .what = "other users run DDS on this machine",
          .evidence = std::to_string(foreign.size()) + " segments in /dev/shm, as " +
                      foreign.front().name + ", belong to user " +
                      std::to_string(foreign.front().owner) + ", and we are user " +
                      std::to_string(user),
          .way_out =
              "to talk to them, switch shared memory off on both sides (--udp-only; "
              "dds.shared_memory: false) or run both as one user"};
}

}  // namespace

Findings check_shared_memory(const Evidence& evidence) {
  Findings findings;
  if (!evidence.dds.shared_memory) return findings;
  const HostFacts& host = evidence.host;
  if (!host.shared_memory_fault.empty()) {
    findings.push_back({.severity = Severity::problem,
                        .what = "shared memory cannot be used",
                        .evidence = host.shared_memory_fault,
                        .way_out = "sudo chmod 1777 /dev/shm (in a container: mount a tmpfs "
                                   "there), or use --udp-only and dds.shared_memory: false"});
  }
  std::vector<SharedSegment> stale, foreign;
  for (const SharedSegment& segment : host.segments) {
    if (segment.is_stale) {
      stale.push_back(segment);
    } else if (segment.owner != host.user) {
      foreign.push_back(segment);
    }
  }
  if (!stale.empty()) findings.push_back(stale_finding(stale));
  if (!foreign.empty()) findings.push_back(foreign_finding(foreign, host.user));
  return findings;
}

Findings check_socket_buffers(const Evidence& evidence) {
  const std::uint32_t largest =
      std::min(evidence.host.largest_receive_buffer.value_or(evidence.granted_buffer_bytes),
               evidence.granted_buffer_bytes);
  const std::uint32_t wanted = std::max(scan_bytes, evidence.dds.socket_buffer_bytes);
  if (largest >= wanted) return {};
  return {{.severity = needs_udp(evidence) ? Severity::problem : Severity::advice,
           .what = "UDP buffers are too small for a scan",
           .evidence = "net.core.rmem_max gives " + std::to_string(largest) +
                       " bytes; a scan has up "
                       "to " +
                       std::to_string(scan_bytes) +
                       ", and fragments that do not fit are "
                       "lost",
           .way_out = "sudo sysctl net.core.rmem_max=" + std::to_string(wanted) +
                      " (for good: a line in /etc/sysctl.d/60-stillmap.conf), on both machines"}};
}

Findings check_multicast(const Evidence& evidence) {
  Findings findings;
  std::string without, with;
  for (const NetworkInterface& interface : evidence.host.interfaces) {
    if (!interface.is_up || interface.is_loopback) continue;
    std::string& list = interface.has_multicast ? with : without;
    list.append(list.empty() ? "" : ", ").append(interface.name);
  }
  if (with.empty()) {
    findings.push_back({.severity = Severity::advice,
                        .what = "only peers on this machine can be found",
                        .evidence = without.empty() ? "no network interface but the loopback is up"
                                                    : without + " carries no multicast",
                        .way_out = "bring a network up, or take a DDS profile without multicast "
                                   "that names the peers"});
  } else if (!evidence.host.has_multicast_route) {
    findings.push_back({.severity = Severity::advice,
                        .what = "multicast has no route, and peers find each other by it",
                        .evidence = "no route of /proc/net/route takes 239.255.0.1",
                        .way_out = "sudo ip route add 239.255.0.0/16 dev " + with});
  }
  return findings;
}

}  // namespace stillmap
