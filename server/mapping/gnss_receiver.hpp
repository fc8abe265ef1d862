#pragma once

#include <string>

#include "idl/dds/reader.hpp"
#include "idl/interface/server_status.hpp"
#include "sensor_msgs.h"
#include "server/mapping/loop_corrector.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/monitoring/unreadable_samples.hpp"
#include "server/threads/periodic_worker.hpp"

namespace stillmap::server {

/// Receives sensor_msgs/NavSatFix for the map's corrections. Messages without a fix are counted
/// ("gnss_without_fix"), those that cannot be used, too ("gnss_fixes_refused"), and logged with the
/// reason.
class GnssReceiver {
 public:
  /// All must outlive it.
  GnssReceiver(dds::Participant& participant, const std::string& ros_topic, DeliveryMode delivery,
               LoopCorrector& loops, Statistics& statistics);

 private:
  void take(const sensor_msgs::msg::NavSatFix& message);

  LoopCorrector& loops_;
  Statistics& statistics_;
  ThrottledLog throttled_log_;
  UnreadableSamples unreadable_;
  dds::Reader<sensor_msgs::msg::NavSatFix> reader_;
  // Last: stops before what it uses is gone.
  PeriodicWorker worker_;
};

}  // namespace stillmap::server
