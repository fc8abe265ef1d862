#pragma once

#include <vector>

#include "server/monitoring/metrics_snapshot.hpp"

namespace prometheus {
struct MetricFamily;
}

namespace stillmap::server {

/// The snapshot under Prometheus's conventions: base units, counters ending in _total, one family a
/// quantity with what distinguishes its members as labels.
[[nodiscard]] std::vector<prometheus::MetricFamily> metric_families(
    const MetricsSnapshot& snapshot);

}  // namespace stillmap::server
