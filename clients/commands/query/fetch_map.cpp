#include "clients/commands/query/fetch_map.hpp"

#include <condition_variable>
#include <mutex>
#include <stdexcept>

namespace stillmap::cli {
namespace {

constexpr const char* no_pose = "the server has no pose yet: it has mapped no scan";

}  // namespace

Trajectory fetch_trajectory(Client& client, std::chrono::milliseconds timeout) {
  const dds::ServerStatus status = client.status();
  if (status.map_version == 0 && status.counter("scans_mapped") == 0)
    throw std::runtime_error(no_pose + (status.reason.empty() ? "" : ": " + status.reason));
  std::mutex mutex;
  std::condition_variable arrived;
  Trajectory newest;
  // The server keeps its path for those who come late.
  const Subscription subscription = client.subscribe_path([&](const Trajectory& path) {
    const std::lock_guard lock(mutex);
    newest = path;
    arrived.notify_one();
  });
  std::unique_lock lock(mutex);
  if (!arrived.wait_for(lock, timeout, [&] { return !newest.empty(); })) {
    throw std::runtime_error(no_pose);
  }
  return newest;
}

}  // namespace stillmap::cli
