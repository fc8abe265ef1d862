#pragma once

#include <functional>

#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "server/threads/periodic_worker.hpp"
#include "stillmap_msgs.h"

namespace stillmap::server {

/// Publishes the status every period, and soon after the odometry's health changed.
class StatusPublisher {
 public:
  StatusPublisher(dds::Participant& participant, const dds::Topics& topics, double period_s,
                  std::function<dds::ServerStatus()> status);

 private:
  void publish_when_due();

  std::chrono::duration<double> period_;
  std::function<dds::ServerStatus()> status_;
  std::chrono::steady_clock::time_point last_;
  OdometryHealth last_health_ = OdometryHealth::initialised;
  dds::Writer<stillmap_msgs::msg::Status> writer_;
  // Last: stops before what it uses is gone.
  PeriodicThread thread_;
};

}  // namespace stillmap::server
