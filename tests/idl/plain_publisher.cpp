// A lidar driver on Fast DDS as it comes: a participant, a publisher and a writer with defaults,
// which are those of rmw_fastrtps, too. Its shared memory is smaller than one of its scans.
//
//     plain_publisher DOMAIN POINTS RATE_HZ SCANS DEPTH reliable|best_effort [LOST_PERCENT]
//
// LOST_PERCENT: of the fragments, over UDP. Waits for a subscriber, publishes on rt/points, prints
// how many scans it sent, and stays until SIGTERM.
#include <fastdds/rtps/transport/test_UDPv4TransportDescriptor.h>
#include <signal.h>

#include <chrono>
#include <cmath>
#include <cstring>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <iostream>
#include <memory>
#include <numbers>
#include <span>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "idl/dds/type_support.hpp"
#include "sensor_msgs.h"

namespace {

using namespace std::chrono_literals;
using namespace eprosima::fastdds::dds;
using Clock = std::chrono::steady_clock;
using sensor_msgs::msg::PointCloud2;

struct Options {
  std::int32_t domain_id;
  std::uint32_t points;
  double rate_hz;
  int scans;
  int depth;
  bool reliable;
  std::uint8_t lost_percent;
};

Options options_of(std::span<char*> words) {
  if (words.size() < 7) throw std::invalid_argument("see the head of plain_publisher.cpp");
  return {.domain_id = std::stoi(words[1]),
          .points = static_cast<std::uint32_t>(std::stoul(words[2])),
          .rate_hz = std::stod(words[3]),
          .scans = std::stoi(words[4]),
          .depth = std::stoi(words[5]),
          .reliable = std::string(words[6]) == "reliable",
          .lost_percent = static_cast<std::uint8_t>(words.size() > 7 ? std::stoi(words[7]) : 0)};
}

DomainParticipantQos participant_qos(const Options& options) {
  DomainParticipantQos qos;
  qos.name("plain_publisher");
  if (options.lost_percent == 0) return qos;
  const auto lossy = std::make_shared<eprosima::fastdds::rtps::test_UDPv4TransportDescriptor>();
  lossy->dropDataFragMessagesPercentage = options.lost_percent;
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(lossy);
  return qos;
}

// As rmw_fastrtps sets it; all else is Fast DDS's default.
DataWriterQos writer_qos(const Options& options) {
  DataWriterQos qos;
  qos.history().kind = KEEP_LAST_HISTORY_QOS;
  qos.history().depth = options.depth;
  qos.reliability().kind =
      options.reliable ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
  qos.durability().kind = VOLATILE_DURABILITY_QOS;
  qos.endpoint().history_memory_policy =
      eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  qos.data_sharing().off();
  return qos;
}

PointCloud2 room(std::uint32_t points) {
  constexpr std::uint32_t point_bytes = 16;
  constexpr std::uint8_t float32 = 7;
  PointCloud2 cloud;
  cloud.header().frame_id("lidar");
  cloud.height(1);
  cloud.width(points);
  cloud.point_step(point_bytes);
  cloud.row_step(point_bytes * points);
  cloud.is_dense(true);
  for (const char* name : {"x", "y", "z", "intensity"}) {
    sensor_msgs::msg::PointField field;
    field.name(name);
    field.offset(static_cast<std::uint32_t>(4 * cloud.fields().size()));
    field.datatype(float32);
    field.count(1);
    cloud.fields().push_back(field);
  }
  std::vector<float> values;
  for (std::uint32_t i = 0; i < points; ++i) {
    const float azimuth =
        2.0F * std::numbers::pi_v<float> * static_cast<float>(i) / static_cast<float>(points);
    const float tangent = 0.01F * static_cast<float>(i % 64) - 0.4F;
    const float x = std::cos(azimuth);
    const float y = std::sin(azimuth);
    const float range = 10.0F / std::max(std::abs(x), std::abs(y));
    values.insert(values.end(), {range * x, range * y, range * tangent, 0.5F});
  }
  cloud.data().resize(sizeof(float) * values.size());
  std::memcpy(cloud.data().data(), values.data(), cloud.data().size());
  return cloud;
}

void stamp_now(PointCloud2& cloud) {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  const auto seconds = std::chrono::floor<std::chrono::seconds>(now);
  cloud.header().stamp().sec(static_cast<std::int32_t>(seconds.count()));
  cloud.header().stamp().nanosec(
      static_cast<std::uint32_t>(std::chrono::nanoseconds(now - seconds).count()));
}

void wait_for_subscriber(const DataWriter& writer) {
  const auto deadline = Clock::now() + 60s;
  PublicationMatchedStatus matched;
  while (matched.current_count == 0) {
    if (Clock::now() > deadline) throw std::runtime_error("nobody subscribes to rt/points");
    std::this_thread::sleep_for(20ms);
    writer.get_publication_matched_status(matched);
  }
  // The other side may still lack us.
  std::this_thread::sleep_for(300ms);
}

void run(const Options& options) {
  sigset_t termination;
  sigemptyset(&termination);
  sigaddset(&termination, SIGTERM);
  // Before Fast DDS makes threads, which inherit it.
  sigprocmask(SIG_BLOCK, &termination, nullptr);
  const auto factory = DomainParticipantFactory::get_shared_instance();
  DomainParticipant* const participant =
      factory->create_participant(options.domain_id, participant_qos(options));
  auto type = stillmap::dds::type_support<PointCloud2>();
  type.register_type(participant);
  Topic* const topic =
      participant->create_topic("rt/points", type.get_type_name(), TOPIC_QOS_DEFAULT);
  DataWriter* const writer = participant->create_publisher(PUBLISHER_QOS_DEFAULT)
                                 ->create_datawriter(topic, writer_qos(options));
  wait_for_subscriber(*writer);
  PointCloud2 cloud = room(options.points);
  const std::chrono::duration<double> period(1.0 / options.rate_hz);
  auto next = Clock::now();
  int sent = 0;
  for (int i = 0; i < options.scans; ++i) {
    stamp_now(cloud);
    if (writer->write(&cloud)) ++sent;
    next += std::chrono::duration_cast<Clock::duration>(period);
    std::this_thread::sleep_until(next);
  }
  std::cout << sent << std::endl;
  // What was not acknowledged yet is still repaired.
  int signal = 0;
  sigwait(&termination, &signal);
  participant->delete_contained_entities();
  factory->delete_participant(participant);
}

}  // namespace

int main(int argc, char** argv) try {
  run(options_of({argv, static_cast<std::size_t>(argc)}));
} catch (const std::exception& error) {
  std::cerr << error.what() << "\n";
  return 2;
}
