#pragma once

#include <fastrtps/xmlparser/XMLProfileManager.h>

#include <chrono>
#include <cstddef>
#include <cstdint>

#include "idl/dds/dds_options.hpp"
#include "sensor_msgs.h"
#include "tests/domain_lease.hpp"
#include "tests/eventually.hpp"

namespace stillmap::dds {

/// How long what must happen may take on a busy machine.
inline constexpr std::chrono::seconds discovery_timeout{20 * test::slowdown};

/// A message of a size, told from others by its width and its bytes.
inline sensor_msgs::msg::PointCloud2 cloud_of(std::size_t bytes, std::uint32_t number) {
  sensor_msgs::msg::PointCloud2 cloud;
  cloud.width(number);
  cloud.data().assign(bytes, static_cast<std::uint8_t>(number));
  return cloud;
}

/// The domain of this process: ctest runs every test in a process of its own.
inline std::uint32_t test_domain_id() {
  static const test::DomainLease lease = test::DomainLease::take();
  return static_cast<std::uint32_t>(lease.domain());
}

/// Makes two participants of one process talk as two processes do. Otherwise Fast DDS hands samples
/// over directly, past every transport, and never offers a rejected sample again.
inline void talk_over_transports() {
  eprosima::fastrtps::LibrarySettingsAttributes settings;
  settings.intraprocess_delivery = eprosima::fastrtps::INTRAPROCESS_OFF;
  eprosima::fastrtps::xmlparser::XMLProfileManager::library_settings(settings);
}

/// What processes do that set nothing.
inline void hand_over_in_process() {
  eprosima::fastrtps::LibrarySettingsAttributes settings;
  settings.intraprocess_delivery = eprosima::fastrtps::INTRAPROCESS_FULL;
  eprosima::fastrtps::xmlparser::XMLProfileManager::library_settings(settings);
}

/// Only this machine, over UDP or with shared memory as well.
inline DdsOptions loopback(bool shared_memory) {
  talk_over_transports();
  DdsOptions options;
  options.domain_id = test_domain_id();
  options.shared_memory = shared_memory;
  options.interfaces = {"127.0.0.1"};
  return options;
}

}  // namespace stillmap::dds
