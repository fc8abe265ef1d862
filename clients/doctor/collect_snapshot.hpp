#pragma once

#include <chrono>
#include <filesystem>
#include <string>

#include "clients/doctor/system_snapshot.hpp"

namespace stillmap::cli {

struct DoctorOptions {
  dds::DdsOptions dds;
  std::string server_name = "stillmap";
  std::string points_topic = "points";
  /// Longest wait for a server's answer.
  std::chrono::milliseconds timeout{5000};
  /// How long to listen to the domain.
  std::chrono::milliseconds listening{4000};
  /// Where /proc, /sys and /dev/shm of the machine lie.
  std::filesystem::path host_root = "/";
};

/// Joins the domain for a few seconds and reads the state of the machine. Throws DdsError when it
/// cannot join.
[[nodiscard]] SystemSnapshot collect_snapshot(const DoctorOptions& options);

}  // namespace stillmap::cli
