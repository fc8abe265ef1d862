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
  /// How long the domain is listened to.
  std::chrono::milliseconds listening{4000};
  /// Where /proc, /sys and /dev/shm of the machine lie.
  std::filesystem::path host_root = "/";
};

/// Takes part in the domain for a few seconds and looks at the machine. Throws DdsError where even
/// that is not possible.
[[nodiscard]] SystemSnapshot collect_snapshot(const DoctorOptions& options);

}  // namespace stillmap::cli
