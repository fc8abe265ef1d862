#include "server/mapping/scan_doubts_report.hpp"

#include <spdlog/spdlog.h>

#include <utility>

namespace stillmap::server {
namespace {

std::vector<dds::Diagnostic> diagnostics_of(const std::string& whose,
                                            const ScanDoubts::Look& look) {
  std::vector<dds::Diagnostic> all;
  if (look.are_parts) {
    all.push_back(
        {.severity = dds::Severity::problem,
         .what = whose + " that follow each other look into other directions, as parts of one "
                         "turn, or as several lidars on one topic",
         .evidence = "of half turns every second scan is lost, and poses may be metres off",
         .hint = "'input: {clouds_per_turn: auto}' in the server's file joins parts of a turn; "
                 "several lidars stand in 'sensors'"});
  }
  if (look.up) {
    all.push_back({.severity = dds::Severity::advice,
                   .what = whose + " seem to have other axes: " + *look.up +
                           " is up, while x is taken for ahead, y for left and z for up",
                   .evidence = "the ground that they seem to show, unless that is a ceiling or a "
                               "wall",
                   .hint = "'input: {fields: ...}' in the server's file puts other axes right (" +
                           fields_for_up_axis(*look.up) +
                           "), 'mount' with 'frames.base' says how a lidar hangs"});
  }
  return all;
}

}  // namespace

ScanDoubtsReport::ScanDoubtsReport(std::string topic, bool is_mount_known)
    : topic_(std::move(topic)), is_mount_known_(is_mount_known) {}

void ScanDoubtsReport::add(const std::string& lidar, const Scan& scan) {
  ScanDoubts& doubts = of_lidars_.try_emplace(lidar, is_mount_known_).first->second;
  if (!doubts.add(scan)) return;
  const std::string whose =
      "scans on " + topic_ + (lidar.empty() ? "" : " of lidar '" + lidar + "'");
  std::vector<dds::Diagnostic> all = diagnostics_of(whose, doubts.said());
  for (const dds::Diagnostic& one : all)
    spdlog::warn("{} ({}): {}", one.what, one.evidence, one.hint);
  if (all.empty()) spdlog::info("{} no longer seem to be other than they are taken for", whose);
  const std::scoped_lock lock(mutex_);
  said_[lidar] = std::move(all);
}

std::vector<dds::Diagnostic> ScanDoubtsReport::diagnostics() const {
  const std::scoped_lock lock(mutex_);
  std::vector<dds::Diagnostic> all;
  for (const auto& [lidar, of_lidar] : said_)
    all.insert(all.end(), of_lidar.begin(), of_lidar.end());
  return all;
}

}  // namespace stillmap::server
