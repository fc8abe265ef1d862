#include "idl/dds/security/access.hpp"

#include <fnmatch.h>

#include <algorithm>

namespace stillmap::dds {
namespace {

bool any_matches(const std::vector<std::string>& expressions, const std::string& topic) {
  return std::ranges::any_of(expressions, [&](const std::string& expression) {
    return ::fnmatch(expression.c_str(), topic.c_str(), 0) == 0;
  });
}

}  // namespace

bool Access::may_publish(const std::string& topic) const { return any_matches(publish, topic); }
bool Access::may_subscribe(const std::string& topic) const { return any_matches(subscribe, topic); }

}  // namespace stillmap::dds
