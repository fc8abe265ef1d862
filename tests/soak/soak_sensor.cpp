// A sensor for a long run: drives round and round in a room, 10 scans a second, so that the map is
// complete after the first round.
//
//   soak_sensor SERVER_DOMAIN SECONDS
//
// Prints how many scans were sent, once a second; at the end until the server has taken all.

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <numbers>
#include <thread>

#include "clients/library/scan_publisher.hpp"
#include "tests/server/room_scans.hpp"

namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto scan_period = 100ms;
constexpr double radius_m = 5.0;
constexpr double scans_a_round = 200.0;

/// On a circle in the hall, heading along it.
stillmap::StampedPose round_pose(std::int64_t index) {
  const double angle = 2.0 * std::numbers::pi * static_cast<double>(index) / scans_a_round;
  const Eigen::Vector3d position_map(radius_m * std::cos(angle), radius_m * std::sin(angle), 0.0);
  return {.stamp_ns = 1'700'000'000'000'000'000 + index * 100'000'000,
          .T_map_lidar = Eigen::Isometry3d(
              Eigen::Translation3d(position_map) *
              Eigen::AngleAxisd(angle + std::numbers::pi / 2.0, Eigen::Vector3d::UnitZ()))};
}

int drive(std::uint32_t domain_id, std::chrono::seconds duration) {
  stillmap::ScanPublisherOptions options;
  options.dds.domain_id = domain_id;
  options.dds.interfaces = {"127.0.0.1"};
  options.lossless = true;
  stillmap::ScanPublisher publisher(options);
  if (!publisher.wait_for_subscriber(30s)) return 3;
  const auto begin = Clock::now();
  auto next = begin;
  std::int64_t sent = 0;
  while (Clock::now() - begin < duration) {
    const stillmap::Scan scan = stillmap::test::seen_in_room(round_pose(sent));
    while (!publisher.publish(scan)) std::puts("waiting for the server");
    if (++sent % 10 == 0) std::printf("sent %lld\n", static_cast<long long>(sent));
    std::fflush(stdout);
    // After a hold-up the rate is kept, not caught up with.
    next = std::max(next + scan_period, Clock::now());
    std::this_thread::sleep_until(next);
  }
  const bool all_taken = publisher.wait_for_all_acknowledged(60s);
  std::printf("sent %lld\n", static_cast<long long>(sent));
  return all_taken ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: %s DOMAIN SECONDS\n", argv[0]);
    return 2;
  }
  try {
    return drive(static_cast<std::uint32_t>(std::atoi(argv[1])),
                 std::chrono::seconds(std::atoi(argv[2])));
  } catch (const std::exception& fault) {
    std::fprintf(stderr, "soak_sensor: %s\n", fault.what());
    return 1;
  }
}
