#include "server/monitoring/throttled_log.hpp"

#include <spdlog/spdlog.h>

namespace stillmap::server {
namespace {

constexpr std::chrono::seconds min_interval{5};

}  // namespace

std::string ThrottledLog::due(const std::string& kind, const std::string& text) {
  const auto now = std::chrono::steady_clock::now();
  const auto [known, is_new] = kinds_.try_emplace(kind, Kind{.last = now});
  if (!is_new && now - known->second.last < min_interval) {
    ++known->second.suppressed;
    return {};
  }
  const std::uint64_t suppressed = known->second.suppressed;
  known->second = {.last = now};
  if (suppressed == 0) return text;
  return text + " (and " + std::to_string(suppressed) + " more of this kind)";
}

void ThrottledLog::warn(const std::string& kind, const std::string& text) {
  if (const std::string line = due(kind, text); !line.empty()) spdlog::warn("{}", line);
}

void ThrottledLog::error(const std::string& kind, const std::string& text) {
  if (const std::string line = due(kind, text); !line.empty()) spdlog::error("{}", line);
}

}  // namespace stillmap::server
