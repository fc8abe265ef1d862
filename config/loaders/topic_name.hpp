#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace stillmap {

inline constexpr std::string_view topic_rule =
    "; ROS 2 names have letters, digits, '_', and '/' between parts that begin with no digit";

/// Of what a topic or a server is called. DDS names have 255 characters at most, which Fast DDS
/// cuts without a word; this leaves room for "rt/" and for the longest name of a service behind it.
inline constexpr std::size_t longest_topic_name = 200;

/// Whether a part of a name begins with a digit.
[[nodiscard]] inline bool has_part_with_digit_first(std::string_view name) {
  for (std::size_t i = 0; i < name.size(); ++i) {
    const bool is_first = i == 0 || name[i - 1] == '/';
    if (is_first && name[i] >= '0' && name[i] <= '9') return true;
  }
  return false;
}

/// Whether it is a ROS 2 name without the '/' at its front. No node can use one with a part that
/// begins with a digit.
[[nodiscard]] inline bool is_topic_name(std::string_view name) {
  constexpr std::string_view allowed =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_/";
  return !name.empty() && name.find_first_not_of(allowed) == std::string_view::npos &&
         name.front() != '/' && name.back() != '/' && name.find("//") == std::string_view::npos &&
         !has_part_with_digit_first(name);
}

/// Takes away the '/' at the front with which ROS 2's own tools print names. Returns what is wrong
/// with the rest; empty where it is a name.
[[nodiscard]] inline std::string to_topic_name(std::string& name) {
  const std::string given = name;
  if (name.starts_with('/')) name.erase(0, 1);
  if (name.size() > longest_topic_name) {
    // Not "'" + given: GCC 12 warns of that where it is inlined.
    std::string fault(1, '\'');
    fault.append(given, 0, 40).append("...' has ").append(std::to_string(name.size()));
    return fault + " characters; a topic's name has " + std::to_string(longest_topic_name) +
           " at most";
  }
  if (is_topic_name(name)) return {};
  return "'" + given + "' is no topic name" + std::string(topic_rule);
}

/// The same where no topic may be named.
[[nodiscard]] inline std::string to_topic_name_or_empty(std::string& name) {
  return name.empty() ? std::string() : to_topic_name(name);
}

/// What is wrong with a list of topics, to be read after its name; empty where it has one or more,
/// each once.
[[nodiscard]] inline std::string topic_list_fault(const std::vector<std::string>& names) {
  if (names.empty()) return "names no topic; give one or more";
  for (auto name = names.begin(); name != names.end(); ++name) {
    if (std::find(names.begin(), name, *name) == name) continue;
    return "names '" + *name + "' twice; name a topic once, also where lidars share it";
  }
  return {};
}

}  // namespace stillmap
