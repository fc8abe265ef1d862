#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "clients/doctor/checks.hpp"

namespace stillmap::cli {
namespace {

// Larger offsets break tf lookups.
constexpr double max_clock_offset_s = 0.1;
// Older scans are taken to be replayed.
constexpr double replayed_age_s = 3600.0;

std::string seconds(double value) {
  std::array<char, 32> text{};
  const int length = std::snprintf(text.data(), text.size(), "%.2f s", value);
  return {text.data(), static_cast<std::size_t>(length)};
}

void compare_with_server(const DiscoveredServer& server, Diagnostics& diagnostics) {
  const double difference_s = 1e-9 * static_cast<double>(server.status->stamp_ns - server.asked_ns);
  const double uncertainty_s = 0.5e-9 * static_cast<double>(server.round_trip_ns);
  if (std::abs(difference_s) <= max_clock_offset_s + uncertainty_s) return;
  diagnostics.push_back({.severity = dds::Severity::problem,
                         .what = "this machine's clock and the server's differ",
                         .evidence = "the server's is " + seconds(std::abs(difference_s)) +
                                     (difference_s > 0 ? " ahead" : " behind") + ", +- " +
                                     seconds(uncertainty_s),
                         .hint = "keep both by NTP or PTP (timedatectl set-ntp true; chrony)"});
}

void compare_with_sensor(const dds::ServerStatus& status, Diagnostics& diagnostics) {
  const double delay_s = status.scan_delay_s;
  if (status.counter("scans_received") == 0 || delay_s > replayed_age_s) return;
  if (delay_s >= -max_clock_offset_s && delay_s <= 1.0) return;
  diagnostics.push_back(
      {.severity = dds::Severity::advice,
       .what = delay_s < 0 ? "scans come from the future" : "scans come late",
       .evidence = "the last scan's stamp is " + seconds(std::abs(delay_s)) +
                   (delay_s < 0 ? " ahead of" : " behind") + " the server's clock",
       .hint = "keep the sensor's clock and the server's by PTP or NTP, and let the driver take "
               "the sensor's time; a replayed bag has old stamps"});
}

bool is_same(const dds::Diagnostic& a, const dds::Diagnostic& b) { return a.what == b.what; }

}  // namespace

Diagnostics check_clocks(const SystemSnapshot& snapshot) {
  Diagnostics diagnostics;
  const DiscoveredServer* const server = answering_server(snapshot);
  if (server == nullptr) return diagnostics;
  compare_with_server(*server, diagnostics);
  compare_with_sensor(*server->status, diagnostics);
  return diagnostics;
}

Diagnostics check_server_diagnostics(const SystemSnapshot& snapshot) {
  const DiscoveredServer* const server = answering_server(snapshot);
  return server == nullptr ? Diagnostics() : server->status->diagnostics;
}

Diagnostics diagnose(const SystemSnapshot& snapshot) {
  constexpr std::array checks{check_shared_memory, check_socket_buffers, check_multicast,
                              check_domain,        check_security,       check_silent_participants,
                              check_servers,       check_endpoints,      check_scans,
                              check_frames,        check_clocks,         check_server_diagnostics};
  Diagnostics all;
  for (const auto check : checks) {
    for (dds::Diagnostic& diagnostic : check(snapshot)) {
      const bool is_known = std::ranges::any_of(
          all, [&](const dds::Diagnostic& known) { return is_same(known, diagnostic); });
      if (!is_known) all.push_back(std::move(diagnostic));
    }
  }
  std::ranges::stable_sort(all, std::ranges::greater(), &dds::Diagnostic::severity);
  return all;
}

}  // namespace stillmap::cli
