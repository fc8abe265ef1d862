#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "clients/doctor/checks.hpp"

namespace stillmap {
namespace {

// What tf, and people, still take for one clock.
constexpr double tolerable_s = 0.1;
// Scans older than that are a recording's.
constexpr double recording_s = 3600.0;

std::string seconds(double value) {
  std::array<char, 32> text{};
  const int length = std::snprintf(text.data(), text.size(), "%.2f s", value);
  return {text.data(), static_cast<std::size_t>(length)};
}

void compare_with_server(const ServerSeen& server, Findings& findings) {
  const double difference_s = 1e-9 * static_cast<double>(server.status->stamp_ns - server.asked_ns);
  const double uncertain_s = 0.5e-9 * static_cast<double>(server.round_trip_ns);
  if (std::abs(difference_s) <= tolerable_s + uncertain_s) return;
  findings.push_back({.severity = Severity::problem,
                      .what = "this machine's clock and the server's differ",
                      .evidence = "the server's is " + seconds(std::abs(difference_s)) +
                                  (difference_s > 0 ? " ahead" : " behind") + ", +- " +
                                  seconds(uncertain_s),
                      .way_out = "keep both by NTP or PTP (timedatectl set-ntp true; chrony)"});
}

void compare_with_sensor(const ServerStatus& status, Findings& findings) {
  const double delay_s = status.scan_delay_s;
  if (status.counter("scans_received") == 0 || delay_s > recording_s) return;
  if (delay_s >= -tolerable_s && delay_s <= 1.0) return;
  findings.push_back(
      {.severity = Severity::advice,
       .what = delay_s < 0 ? "scans come from the future" : "scans come late",
       .evidence = "the last scan's stamp is " + seconds(std::abs(delay_s)) +
                   (delay_s < 0 ? " ahead of" : " behind") + " the server's clock",
       .way_out = "keep the sensor's clock and the server's by PTP or NTP, and let the driver take "
                  "the sensor's time; a recording that is replayed has old stamps"});
}

bool says_the_same(const Finding& a, const Finding& b) { return a.what == b.what; }

}  // namespace

Findings check_clocks(const Evidence& evidence) {
  Findings findings;
  const ServerSeen* const server = answering_server(evidence);
  if (server == nullptr) return findings;
  compare_with_server(*server, findings);
  compare_with_sensor(*server->status, findings);
  return findings;
}

Findings check_server_findings(const Evidence& evidence) {
  const ServerSeen* const server = answering_server(evidence);
  return server == nullptr ? Findings() : server->status->findings;
}

Findings diagnose(const Evidence& evidence) {
  constexpr std::array checks{check_shared_memory, check_socket_buffers, check_multicast,
                              check_domain,        check_security,       check_silent_peers,
                              check_servers,       check_endpoints,      check_scans,
                              check_frames,        check_clocks,         check_server_findings};
  Findings all;
  for (const auto check : checks) {
    for (Finding& finding : check(evidence)) {
      const bool is_known = std::ranges::any_of(
          all, [&](const Finding& known) { return says_the_same(known, finding); });
      if (!is_known) all.push_back(std::move(finding));
    }
  }
  std::ranges::stable_sort(all, std::ranges::greater(), &Finding::severity);
  return all;
}

}  // namespace stillmap
