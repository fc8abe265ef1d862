#pragma once

#include "server/mapping/map_saver.hpp"

namespace stillmap::test {

/// For a MapSaver without a mapping thread: a checkpoint is always the whole latest map.
class LatestMapSource : public server::CheckpointSource {
 public:
  explicit LatestMapSource(const server::LatestMap& latest_map) : latest_map_(latest_map) {}
  [[nodiscard]] server::RunCheckpoint checkpoint(CheckpointScope /*scope*/) override {
    return {{*latest_map_.view(), {}, latest_map_.trajectory(), {}, false}, 0};
  }
  void checkpoint_stored(std::uint64_t /*step*/) override {}
  void checkpoint_failed() override {}
  [[nodiscard]] MemoryUse memory_use() override { return {}; }

 private:
  const server::LatestMap& latest_map_;
};

}  // namespace stillmap::test
