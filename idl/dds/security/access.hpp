#pragma once

#include <string>
#include <vector>

namespace stillmap::dds {

/// What an identity may do: DDS topic names ("rt/points"), in which * and ? stand for anything.
struct Access {
  std::vector<std::string> publish;
  std::vector<std::string> subscribe;

  [[nodiscard]] bool may_publish(const std::string& topic) const;
  [[nodiscard]] bool may_subscribe(const std::string& topic) const;
};

}  // namespace stillmap::dds
