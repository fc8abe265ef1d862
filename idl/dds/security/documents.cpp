#include "idl/dds/security/documents.hpp"

#include <fnmatch.h>

#include <algorithm>
#include <array>
#include <ctime>
#include <string_view>
#include <vector>

namespace stillmap::dds {
namespace {

bool any_matches(const std::vector<std::string>& expressions, const std::string& topic) {
  return std::ranges::any_of(expressions, [&](const std::string& expression) {
    return ::fnmatch(expression.c_str(), topic.c_str(), 0) == 0;
  });
}

using std::chrono::sys_seconds;

constexpr const char* all_domains =
    "<domains><id_range><min>0</min><max>232</max></id_range></domains>\n";

constexpr const char* time_format = "%Y-%m-%dT%H:%M:%S";

std::string to_xml_time(sys_seconds time) {
  const std::time_t seconds = time.time_since_epoch().count();
  std::tm parts{};
  ::gmtime_r(&seconds, &parts);
  std::array<char, 32> text{};
  const std::size_t length = std::strftime(text.data(), text.size(), time_format, &parts);
  return {text.data(), length};
}

std::optional<sys_seconds> from_xml_time(const std::string& text) {
  std::tm parts{};
  if (::strptime(text.c_str(), time_format, &parts) == nullptr) return std::nullopt;
  return sys_seconds(std::chrono::seconds(::timegm(&parts)));
}

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string topics_element(const std::string& action, const std::vector<std::string>& topics) {
  std::string text = "<" + action + "><topics>\n";
  for (const std::string& topic : topics) text += "  <topic>" + escaped(topic) + "</topic>\n";
  return text + "</topics></" + action + ">\n";
}

// The texts of all elements of this name, in their order.
std::vector<std::string> elements(const std::string& text, const std::string& name) {
  std::vector<std::string> found;
  const std::string begin = "<" + name + ">";
  const std::string end = "</" + name + ">";
  for (std::size_t at = text.find(begin); at != std::string::npos; at = text.find(begin, at)) {
    at += begin.size();
    const std::size_t close = text.find(end, at);
    if (close == std::string::npos) break;
    found.push_back(text.substr(at, close - at));
  }
  return found;
}

std::vector<std::string> topics_in(const std::string& text, const std::string& action) {
  std::vector<std::string> topics;
  for (const std::string& part : elements(text, action)) {
    const auto more = elements(part, "topic");
    topics.insert(topics.end(), more.begin(), more.end());
  }
  return topics;
}

}  // namespace

bool Access::may_publish(const std::string& topic) const { return any_matches(publish, topic); }
bool Access::may_subscribe(const std::string& topic) const { return any_matches(subscribe, topic); }

std::string governance_text() {
  return std::string(
             "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n"
             "<dds xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" "
             "xsi:noNamespaceSchemaLocation=\"omg_shared_ca_governance.xsd\">\n"
             "<domain_access_rules><domain_rule>\n") +
         all_domains +
         "<allow_unauthenticated_participants>false</allow_unauthenticated_participants>\n"
         "<enable_join_access_control>true</enable_join_access_control>\n"
         "<discovery_protection_kind>ENCRYPT</discovery_protection_kind>\n"
         "<liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>\n"
         "<rtps_protection_kind>NONE</rtps_protection_kind>\n"
         "<topic_access_rules><topic_rule>\n"
         "<topic_expression>*</topic_expression>\n"
         "<enable_discovery_protection>true</enable_discovery_protection>\n"
         "<enable_liveliness_protection>true</enable_liveliness_protection>\n"
         "<enable_read_access_control>true</enable_read_access_control>\n"
         "<enable_write_access_control>true</enable_write_access_control>\n"
         "<metadata_protection_kind>NONE</metadata_protection_kind>\n"
         "<data_protection_kind>ENCRYPT</data_protection_kind>\n"
         "</topic_rule></topic_access_rules>\n"
         "</domain_rule></domain_access_rules>\n"
         "</dds>\n";
}

std::string to_text(const Permissions& permissions) {
  std::string text =
      "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n"
      "<dds xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" "
      "xsi:noNamespaceSchemaLocation=\"omg_shared_ca_permissions.xsd\">\n"
      "<permissions><grant name=\"stillmap\">\n";
  text += "<subject_name>" + escaped(permissions.subject) + "</subject_name>\n";
  text += "<validity>\n<not_before>" + to_xml_time(permissions.validity.from) +
          "</not_before>\n<not_after>" + to_xml_time(permissions.validity.to) +
          "</not_after>\n</validity>\n";
  text += std::string("<allow_rule>\n") + all_domains;
  text += topics_element("publish", permissions.access.publish);
  text += topics_element("subscribe", permissions.access.subscribe);
  return text + "</allow_rule>\n<default>DENY</default>\n</grant></permissions>\n</dds>\n";
}

std::optional<Permissions> permissions_from_text(const std::string& text) {
  const auto subjects = elements(text, "subject_name");
  const auto begins = elements(text, "not_before");
  const auto ends = elements(text, "not_after");
  if (subjects.size() != 1 || begins.size() != 1 || ends.size() != 1) return std::nullopt;
  const auto from = from_xml_time(begins.front());
  const auto to = from_xml_time(ends.front());
  if (!from || !to) return std::nullopt;
  return Permissions{
      .subject = subjects.front(),
      .validity = {.from = *from, .to = *to},
      .access = {.publish = topics_in(text, "publish"), .subscribe = topics_in(text, "subscribe")}};
}

}  // namespace stillmap::dds
