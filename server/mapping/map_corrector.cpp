#include "server/mapping/map_corrector.hpp"

#include <chrono>
#include <utility>

#include "server/mapping/milliseconds.hpp"
#include "server/threads/background_throttle.hpp"

namespace stillmap::server {

namespace {

MapCorrector::Result corrected(StaticMap& map, MapCorrection correction, std::size_t limit_bytes) {
  const auto began = std::chrono::steady_clock::now();
  MapCorrector::Result result{std::move(correction), std::nullopt, nullptr, 0.0};
  run_behind_the_mapper([&] {
    result.corrected = map.correct(result.correction, limit_bytes);
    result.view = map.view();
  });
  result.ms = milliseconds(std::chrono::steady_clock::now() - began);
  return result;
}

}  // namespace

// Not at a lower priority: mapping waits for it in the end.
void MapCorrector::begin(MapCorrection correction) {
  work_ = std::async(std::launch::async, [this, &map = mapper_.lend_static_map(),
                                          correction = std::move(correction)]() mutable {
    return corrected(map, std::move(correction), limit_bytes_);
  });
}

std::optional<MapCorrector::Result> MapCorrector::take(bool waits) {
  if (!is_running()) return std::nullopt;
  const bool is_full = mapper_.kept_scans() >= max_kept_scans;
  if (!waits && !is_full && work_.wait_for(std::chrono::seconds(0)) != std::future_status::ready)
    return std::nullopt;
  try {
    Result result = work_.get();
    mapper_.reclaim_static_map(result.corrected ? &result.correction : nullptr);
    return result;
  } catch (...) {
    mapper_.reclaim_static_map(nullptr);
    throw;
  }
}

bool MapCorrector::insert_kept(const std::function<bool()>& has_time) {
  constexpr std::size_t at_once = 2;
  if (is_running()) return false;
  do {
    if (mapper_.kept_scans() > 0) {
      mapper_.insert_kept_scans(at_once);
    } else {
      mapper_.insert_confirmed_scans(at_once);
    }
  } while (mapper_.kept_scans() + mapper_.confirmed_scans() > 0 && has_time());
  return mapper_.kept_scans() == 0;
}

}  // namespace stillmap::server
