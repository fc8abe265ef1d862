#include "server/monitoring/throttled_log.hpp"

#include <spdlog/spdlog.h>

namespace stillmap {
namespace {

constexpr std::chrono::seconds shortest_pause{5};

}  // namespace

std::string RareWarnings::due(const std::string& kind, const std::string& text) {
  const auto now = std::chrono::steady_clock::now();
  const auto [known, is_new] = kinds_.try_emplace(kind, Kind{.last = now});
  if (!is_new && now - known->second.last < shortest_pause) {
    ++known->second.left_out;
    return {};
  }
  const std::uint64_t left_out = known->second.left_out;
  known->second = {.last = now};
  if (left_out == 0) return text;
  return text + " (and " + std::to_string(left_out) + " more of this kind)";
}

void RareWarnings::warn(const std::string& kind, const std::string& text) {
  if (const std::string line = due(kind, text); !line.empty()) spdlog::warn("{}", line);
}

void RareWarnings::error(const std::string& kind, const std::string& text) {
  if (const std::string line = due(kind, text); !line.empty()) spdlog::error("{}", line);
}

}  // namespace stillmap
