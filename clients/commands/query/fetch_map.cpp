#include "clients/commands/query/fetch_map.hpp"

#include <condition_variable>
#include <mutex>
#include <stdexcept>
#include <string>

namespace stillmap::cli {

Trajectory fetch_trajectory(Client& client, std::chrono::milliseconds timeout) {
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
    lock.unlock();
    const std::string reason = client.status().reason;
    throw std::runtime_error("the server has no pose yet: it has mapped no scan" +
                             (reason.empty() ? "" : ": " + reason));
  }
  return newest;
}

}  // namespace stillmap::cli
