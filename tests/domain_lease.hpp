#pragma once

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

namespace stillmap::test {

/// A DDS domain that no other test of this user takes as long as this lives, also when its
/// process is killed.
class DomainLease {
 public:
  /// Domain 0 stays free for people, the last ones for what a test runs beside.
  static constexpr int first_domain = 20;
  static constexpr int last_domain = 219;

  static DomainLease take() {
    std::mt19937 random(std::random_device{}());
    for (int attempt = 0; attempt < 1000; ++attempt) {
      const int domain = std::uniform_int_distribution(first_domain, last_domain)(random);
      if (auto lease = try_to_take(domain)) return std::move(*lease);
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    throw std::runtime_error("no free DDS domain");
  }

  DomainLease(DomainLease&& other) noexcept
      : domain_(other.domain_), file_(std::exchange(other.file_, -1)) {}
  DomainLease& operator=(DomainLease&&) = delete;
  ~DomainLease() {
    if (file_ >= 0) ::close(file_);
  }

  [[nodiscard]] int domain() const { return domain_; }

 private:
  DomainLease(int domain, int file) : domain_(domain), file_(file) {}

  static std::optional<DomainLease> try_to_take(int domain) {
    // Of this user: files of others cannot be opened. Their processes are seen by their sockets.
    const auto name =
        std::filesystem::temp_directory_path() /
        ("stillmap-test-domain-" + std::to_string(domain) + "-of-" + std::to_string(::getuid()));
    DomainLease lease(domain, ::open(name.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666));
    // Somebody else's process may still use it without a lease.
    if (lease.file_ < 0 || ::flock(lease.file_, LOCK_EX | LOCK_NB) != 0 || is_used(domain)) {
      return std::nullopt;
    }
    return lease;
  }

  /// Whether some socket of this machine has the domain's discovery port (RTPS 9.6.1), as
  /// /proc/net/udp lists them. One that is bound to the multicast group alone is no participant's,
  /// but that of `stillmap doctor`, which listens to all domains at once.
  static bool is_used(int domain) {
    const unsigned discovery_port = 7400U + 250U * static_cast<unsigned>(domain);
    constexpr unsigned group = 0x0100FFEF;  // 239.255.0.1
    std::ifstream stream("/proc/net/udp");
    for (std::string line; std::getline(stream, line);) {
      unsigned address = 0;
      unsigned port = 0;
      if (std::sscanf(line.c_str(), " %*d: %x:%x", &address, &port) != 2) continue;
      if (port == discovery_port && address != group) return true;
    }
    return false;
  }

  int domain_;
  int file_;
};

}  // namespace stillmap::test
