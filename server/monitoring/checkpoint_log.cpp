#include "server/monitoring/checkpoint_log.hpp"

namespace stillmap::server {

CheckpointLog::Attempt::~Attempt() {
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began_;
  const std::scoped_lock lock(log_.mutex_);
  if (!is_stored_) {
    ++log_.record_.failures;
    return;
  }
  log_.record_.times.add(took.count());
  log_.record_.last_stored = std::chrono::system_clock::now();
}

CheckpointLog::Record CheckpointLog::record() const {
  const std::scoped_lock lock(mutex_);
  return record_;
}

}  // namespace stillmap::server
