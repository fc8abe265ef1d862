#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "clients/library/client.hpp"
#include "clients/library/scan_publisher.hpp"
#include "tests/eventually.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap::test {

/// A running stillmap-server, killed when this goes.
class ServerProcess {
 public:
  explicit ServerProcess(const std::vector<std::string>& arguments);
  ~ServerProcess();
  ServerProcess(const ServerProcess&) = delete;
  ServerProcess& operator=(const ServerProcess&) = delete;

  void send(int signal) const;
  /// Its exit code; -1 when a signal ended it, -2 when it still runs after `timeout`.
  [[nodiscard]] int wait_for_exit(std::chrono::seconds timeout);

 private:
  pid_t pid_ = 0;
};

/// Files and options of one test's server and clients, in a domain of their own.
class ServiceSetup {
 public:
  /// `delivery`: "latest" or "every". `map_options`: fields of the section `map`. `sensors`: the
  /// line of the server's file that names them.
  explicit ServiceSetup(const std::string& delivery,
                        const std::string& map_options = "save_period_s: 3600",
                        const std::string& sensors = "sensor: vlp_16");

  /// More sections of the server's file.
  void add(const std::string& yaml) const;

  [[nodiscard]] std::vector<std::string> server_arguments() const;
  [[nodiscard]] dds::DdsOptions dds() const;
  [[nodiscard]] ClientOptions client() const;
  [[nodiscard]] ScanPublisherOptions publisher(bool lossless) const;
  [[nodiscard]] std::filesystem::path map_file() const { return folder_ / "map.stillmap"; }

 private:
  ScratchFolder folder_;
};

/// Publishes scans `first` .. `last` - 1 of the room without losing one.
void drive(ScanPublisher& publisher, int first, int last);

/// Waits until the server dealt with this many scans, by mapping or dropping them.
[[nodiscard]] bool wait_for_scans(Client& client, std::uint64_t scans);

}  // namespace stillmap::test
