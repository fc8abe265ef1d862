#include "server/mapping/imu_receiver.hpp"

#include <utility>

#include "idl/conversions/imu.hpp"
#include "idl/interface/topics.hpp"

namespace stillmap::server {
namespace {

/// 20 s at 400 Hz.
constexpr std::size_t max_waiting = 8000;
/// After so many waits in vain the IMU has stopped, or has another clock.
constexpr int max_vain_waits = 5;

std::chrono::milliseconds patience_of(DeliveryMode delivery) {
  // A replay waits for the server: what is not there yet is on its way.
  return std::chrono::milliseconds(delivery == DeliveryMode::every ? 500 : 40);
}

}  // namespace

void ImuQueue::push(const ImuSample& sample) {
  {
    const std::scoped_lock lock(mutex_);
    if (samples_.size() >= max_waiting)
      samples_.erase(samples_.begin(), samples_.begin() + max_waiting / 2);
    samples_.push_back(sample);
    newest_ns_ = sample.stamp_ns;
    const bool was_worth_waiting = missed_ && reaches(missed_->until_ns) &&
                                   std::chrono::steady_clock::now() <= missed_->deadline;
    if (was_worth_waiting) vain_waits_ = 0;
  }
  pushed_.notify_all();
}

std::vector<ImuSample> ImuQueue::take(std::int64_t until_ns, std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  missed_.reset();
  if (reaches(until_ns)) {
    vain_waits_ = 0;
  } else if (patience > std::chrono::milliseconds(0)) {
    if (vain_waits_ < max_vain_waits) {
      const bool came = pushed_.wait_for(lock, patience, [&] { return reaches(until_ns); });
      vain_waits_ = came ? 0 : vain_waits_ + 1;
    } else {
      missed_ = Missed{until_ns, std::chrono::steady_clock::now() + patience};
    }
  }
  return std::exchange(samples_, {});
}

ImuReceiver::ImuReceiver(dds::Participant& participant, const std::string& ros_topic,
                         DeliveryMode delivery, Statistics& statistics)
    : patience_(patience_of(delivery)),
      unreadable_(ros_topic, "imu_unreadable", statistics),
      reader_(participant, dds::imu_topic(ros_topic, delivery).dds_name,
              dds::imu_topic(ros_topic, delivery).reader),
      worker_("imu", std::chrono::seconds(0),
              [this, &statistics,
               message = sensor_msgs::msg::Imu()](const std::stop_token& stop) mutable {
                const bool came = reader_.take(message, stop, std::chrono::seconds(1));
                unreadable_.report(reader_);
                if (!came) return;
                if (const auto sample = wire::from_imu(message)) {
                  queue_.push(*sample);
                } else {
                  statistics.count("imu_not_usable");
                }
              }) {}

std::vector<ImuSample> ImuReceiver::take(std::int64_t until_ns, std::chrono::nanoseconds more) {
  using std::chrono::milliseconds;
  const bool is_published = reader_.matched_writers() > 0;
  const milliseconds patience = patience_ + std::chrono::duration_cast<milliseconds>(more);
  return queue_.take(until_ns + more.count(), is_published ? patience : milliseconds(0));
}

}  // namespace stillmap::server
