#include "idl/dds/ros_domain.hpp"

#include <charconv>
#include <cstdlib>
#include <string>
#include <string_view>
#include <system_error>

#include "idl/dds/dds_error.hpp"
#include "idl/dds/dds_options.hpp"

namespace stillmap::dds {

std::uint32_t ros_domain_id() {
  const char* const variable = std::getenv("ROS_DOMAIN_ID");
  const std::string_view text = variable == nullptr ? "" : variable;
  if (text.empty()) return 0;
  std::uint32_t id = 0;
  const auto [end, fault] = std::from_chars(text.begin(), text.end(), id);
  if (fault == std::errc() && end == text.end() && id <= max_domain_id) return id;
  throw DdsError("ROS_DOMAIN_ID is '" + std::string(text) + "'; domain ids go from 0 to " +
                 std::to_string(max_domain_id));
}

}  // namespace stillmap::dds
