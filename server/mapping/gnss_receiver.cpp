#include "server/mapping/gnss_receiver.hpp"

#include "idl/conversions/gnss.hpp"
#include "idl/interface/topics.hpp"

namespace stillmap::server {

GnssReceiver::GnssReceiver(dds::Participant& participant, const std::string& ros_topic,
                           DeliveryMode delivery, LoopCorrector& loops, Statistics& statistics)
    : loops_(loops),
      statistics_(statistics),
      unreadable_(ros_topic, "gnss_unreadable", statistics),
      reader_(participant, dds::gnss_topic(ros_topic, delivery).dds_name,
              dds::gnss_topic(ros_topic, delivery).reader),
      worker_("gnss", std::chrono::seconds(0),
              [this, message = sensor_msgs::msg::NavSatFix()](const std::stop_token& stop) mutable {
                const bool came = reader_.take(message, stop, std::chrono::seconds(1));
                unreadable_.report(reader_);
                if (came) take(message);
              }) {}

void GnssReceiver::take(const sensor_msgs::msg::NavSatFix& message) {
  const wire::ReceivedFix received = wire::from_nav_sat_fix(message);
  if (received.fix) return loops_.add(*received.fix);
  if (received.fault.empty()) return statistics_.count("gnss_without_fix");
  statistics_.count("gnss_fixes_refused");
  throttled_log_.warn("gnss", "a GNSS fix is not used: " + received.fault);
}

}  // namespace stillmap::server
