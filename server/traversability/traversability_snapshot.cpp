#include "server/traversability/traversability_snapshot.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace stillmap::server {
namespace {

std::string unknown_profile(const std::string& profile,
                            const TraversabilitySnapshot::Views& views) {
  if (views.empty())
    return "this server keeps no areas; its configuration's traversability.profiles is empty";
  std::string text = "profile '" + profile + "' is not one that this server keeps areas for: ";
  for (std::size_t i = 0; i < views.size(); ++i) {
    text += (i == 0 ? "" : ", ") + views[i]->profile.name;
  }
  return text + "; others belong into its configuration's traversability.profiles";
}

}  // namespace

void TraversabilitySnapshot::publish(Views views) {
  const std::scoped_lock lock(mutex_);
  views_ = std::move(views);
}

std::shared_ptr<const TraversabilityView> TraversabilitySnapshot::view(
    const std::string& profile) const {
  const std::scoped_lock lock(mutex_);
  const auto found = std::ranges::find_if(
      views_, [&](const auto& candidate) { return candidate->profile.name == profile; });
  if (found == views_.end()) throw std::invalid_argument(unknown_profile(profile, views_));
  return *found;
}

}  // namespace stillmap::server
