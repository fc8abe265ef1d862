#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/map/static_map.hpp"
#include "idl/interface/server_status.hpp"
#include "server/monitoring/checkpoint_log.hpp"
#include "server/monitoring/service_log.hpp"
#include "server/monitoring/statistics.hpp"

namespace stillmap::server {

/// Of this process, as the kernel counts it.
struct ProcessUse {
  double resident_bytes = 0.0;
  double cpu_seconds = 0.0;
  double open_files = 0.0;
};

[[nodiscard]] ProcessUse process_use();

/// What the server knows of itself at one moment.
struct MetricsSnapshot {
  dds::ServerStatus status;
  std::vector<StageStatistics> stages;
  std::map<std::string, ServiceLog::Service> services;
  CheckpointLog::Record checkpoints;
  MemoryUse map_memory;
  ProcessUse process;
};

}  // namespace stillmap::server
