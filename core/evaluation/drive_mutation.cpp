#include "core/evaluation/drive_mutation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <stdexcept>
#include <utility>

#include "core/lidar/angle_units.hpp"

namespace stillmap::evaluation {
namespace {

using Scans = std::vector<MutatedScan>;

constexpr std::array<std::pair<const char*, DriveMutation>, 8> names{{
    {"none", DriveMutation::none},
    {"drop", DriveMutation::drop},
    {"teleport", DriveMutation::teleport},
    {"other_place", DriveMutation::other_place},
    {"cover", DriveMutation::cover},
    {"cover_all", DriveMutation::cover_all},
    {"jitter", DriveMutation::jitter},
    {"late", DriveMutation::late},
}};

constexpr std::int64_t ms_ns = 1'000'000;
constexpr std::uint32_t jitter_seed = 7;

/// Scans within `duration_ns` of that at `first` are missing.
void drop_from(Scans& scans, std::size_t first, std::int64_t duration_ns) {
  if (first >= scans.size()) return;
  const std::int64_t end_ns = scans[first].stamp_ns + duration_ns;
  std::erase_if(scans, [&, begin_ns = scans[first].stamp_ns](const MutatedScan& scan) {
    return scan.stamp_ns >= begin_ns && scan.stamp_ns < end_ns;
  });
}

void teleport(Scans& scans) {
  const std::size_t n = scans.size();
  std::vector<std::size_t> order;
  const auto play = [&order](std::size_t first, std::size_t end) {
    for (std::size_t i = first; i < end; ++i) order.push_back(i);
  };
  play(0, n / 2);
  play(n - n / 4, n);
  play(n / 4, n);
  for (std::size_t k = 0; k < n; ++k) scans[k].index = order[k];
}

void visit_other_place(Scans& scans, std::size_t other_scans) {
  constexpr std::size_t max_visit = 20;
  const std::size_t first = scans.size() / 2;
  const std::size_t visit = std::min({max_visit, other_scans, scans.size() - first});
  for (std::size_t k = 0; k < visit; ++k) {
    scans[first + k].index = k;
    scans[first + k].of_other_place = true;
  }
}

void cover(Scans& scans, double visible_from_deg, double visible_to_deg) {
  for (std::size_t i = scans.size() / 3; i < 2 * scans.size() / 3; ++i) {
    scans[i].visible_from_deg = visible_from_deg;
    scans[i].visible_to_deg = visible_to_deg;
  }
}

void jitter(Scans& scans) {
  std::mt19937 random(jitter_seed);
  for (MutatedScan& scan : scans) scan.stamp_ns += (static_cast<int>(random() % 91) - 45) * ms_ns;
}

void delay_some(Scans& scans) {
  for (std::size_t i = 10; i < scans.size(); i += 20) scans[i].stamp_ns += 90 * ms_ns;
}

}  // namespace

DriveMutation drive_mutation(const std::string& name) {
  std::string all;
  for (const auto& [known, mutation] : names) {
    if (name == known) return mutation;
    all += (all.empty() ? "" : ", ") + std::string(known);
  }
  throw std::invalid_argument("no mutation '" + name + "': there are " + all);
}

std::vector<MutatedScan> mutate_drive(DriveMutation mutation,
                                      std::span<const std::int64_t> stamps_ns,
                                      std::size_t other_scans) {
  Scans scans;
  for (std::size_t i = 0; i < stamps_ns.size(); ++i)
    scans.push_back({.index = i, .stamp_ns = stamps_ns[i]});
  switch (mutation) {
    case DriveMutation::none:
      break;
    case DriveMutation::drop:
      // The later gap first, so that both are counted in the whole drive.
      drop_from(scans, 2 * stamps_ns.size() / 3, 3000 * ms_ns);
      drop_from(scans, stamps_ns.size() / 3, 1000 * ms_ns);
      break;
    case DriveMutation::teleport:
      teleport(scans);
      break;
    case DriveMutation::other_place:
      visit_other_place(scans, other_scans);
      break;
    case DriveMutation::cover:
      cover(scans, -180.0, 0.0);
      break;
    case DriveMutation::cover_all:
      cover(scans, -10.0, 10.0);
      break;
    case DriveMutation::jitter:
      jitter(scans);
      break;
    case DriveMutation::late:
      delay_some(scans);
      break;
  }
  return scans;
}

Scan mutate_scan(Scan scan, const MutatedScan& mutated) {
  scan.stamp_ns = mutated.stamp_ns;
  const auto is_visible = [&mutated](const Eigen::Vector3f& point_lidar) {
    const double azimuth_deg = std::atan2(point_lidar.y(), point_lidar.x()) * deg_per_rad;
    return azimuth_deg >= mutated.visible_from_deg && azimuth_deg <= mutated.visible_to_deg;
  };
  if (mutated.visible_from_deg <= -180.0 && mutated.visible_to_deg >= 180.0) return scan;
  std::vector<bool> kept;
  for (const Eigen::Vector3f& point : scan.points_lidar) kept.push_back(is_visible(point));
  const auto keep = [&kept](auto& values) {
    std::size_t next = 0;
    for (std::size_t i = 0; i < values.size(); ++i)
      if (kept[i]) values[next++] = values[i];
    values.resize(next);
  };
  keep(scan.points_lidar);
  keep(scan.intensity);
  keep(scan.time_offset_s);
  keep(scan.ring);
  keep(scan.labels);
  return scan;
}

}  // namespace stillmap::evaluation
