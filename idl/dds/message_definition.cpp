#include "idl/dds/message_definition.hpp"

#include <algorithm>
#include <vector>

namespace stillmap::dds {
namespace {

struct Definition {
  std::string_view ros_type;
  std::string_view text;
};

/// In the order of the names.
constexpr Definition definitions[] = {
#include "message_definition_table.inc"
};
static_assert(std::ranges::is_sorted(definitions, {}, &Definition::ros_type));

constexpr std::size_t separator_length = 80;

std::string_view text_of(std::string_view ros_type) {
  const auto* const found =
      std::ranges::lower_bound(definitions, ros_type, {}, &Definition::ros_type);
  const bool is_known = found != std::end(definitions) && found->ros_type == ros_type;
  return is_known ? found->text : std::string_view();
}

/// "std_msgs/Header" of the line "std_msgs/Header header"; empty where it names no other message.
std::string_view message_named_in(std::string_view line) {
  if (line.starts_with('#')) return {};
  const std::string_view type = line.substr(0, line.find_first_of(" ["));
  return type.find('/') == std::string_view::npos ? std::string_view() : type;
}

/// Adds the messages that `text` names, and those that they name, each once.
void collect_used(std::string_view text, std::vector<std::string_view>& used) {
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(line.size() + 1, text.size()));
    const std::string_view name = message_named_in(line);
    if (name.empty() || std::ranges::find(used, name) != used.end()) continue;
    used.push_back(name);
    collect_used(text_of(std::string(name).insert(name.find('/'), "/msg")), used);
  }
}

}  // namespace

std::string message_definition(std::string_view ros_type) {
  std::string whole(text_of(ros_type));
  std::vector<std::string_view> used;
  collect_used(text_of(ros_type), used);
  for (const std::string_view name : used) {
    whole.append(separator_length, '=').append("\nMSG: ").append(name).append("\n");
    whole.append(text_of(std::string(name).insert(name.find('/'), "/msg")));
  }
  return whole;
}

}  // namespace stillmap::dds
