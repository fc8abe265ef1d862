#include "server/rare_warnings.hpp"

#include <spdlog/spdlog.h>

namespace stillmap {
namespace {

constexpr std::chrono::seconds shortest_pause{5};

}  // namespace

void RareWarnings::warn(const std::string& kind, const std::string& text) {
  const auto now = std::chrono::steady_clock::now();
  const auto [known, is_new] = kinds_.try_emplace(kind, Kind{.last = now});
  if (!is_new && now - known->second.last < shortest_pause) {
    ++known->second.left_out;
    return;
  }
  if (known->second.left_out > 0) {
    spdlog::warn("{} (and {} more of this kind)", text, known->second.left_out);
  } else {
    spdlog::warn("{}", text);
  }
  known->second = {.last = now};
}

}  // namespace stillmap
