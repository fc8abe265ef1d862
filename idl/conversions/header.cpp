#include "idl/conversions/header.hpp"

namespace stillmap::wire {
namespace {

constexpr std::int64_t ns_per_s = 1'000'000'000;

}  // namespace

builtin_interfaces::msg::Time to_stamp(std::int64_t stamp_ns) {
  std::int64_t seconds = stamp_ns / ns_per_s;
  std::int64_t rest_ns = stamp_ns % ns_per_s;
  // Before the epoch the fraction still counts forwards.
  if (rest_ns < 0) {
    rest_ns += ns_per_s;
    --seconds;
  }
  builtin_interfaces::msg::Time stamp;
  stamp.sec(static_cast<std::int32_t>(seconds));
  stamp.nanosec(static_cast<std::uint32_t>(rest_ns));
  return stamp;
}

std::optional<std::int64_t> stamp_ns(const builtin_interfaces::msg::Time& stamp) {
  if (stamp.nanosec() >= ns_per_s) return std::nullopt;
  return stamp.sec() * ns_per_s + stamp.nanosec();
}

std_msgs::msg::Header to_header(std::int64_t stamp_ns, const std::string& frame) {
  std_msgs::msg::Header header;
  header.stamp(to_stamp(stamp_ns));
  header.frame_id(frame);
  return header;
}

}  // namespace stillmap::wire
