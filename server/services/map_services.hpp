#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "idl/dds/participant.hpp"
#include "server/services/service_context.hpp"
#include "server/threads/prompt_turns.hpp"

namespace stillmap::server {

/// The server's ends of all services of the table, each on its own thread, so that a large answer
/// delays no other service. On busy cores the mapper goes first, but for short prompt answers.
class MapServices {
 public:
  /// Why a request that changes something is refused before it is looked at; empty when it is not.
  using ChangeRefusal = std::function<std::string()>;

  /// `refuses_changes` is asked for each such request, by several threads. Throws DdsError when the
  /// topics cannot be made.
  MapServices(dds::Participant& participant, const std::string& name_space, ServiceContext context,
              ChangeRefusal refuses_changes);

 private:
  ServiceContext context_;
  PromptBudget prompt_budget_;
  /// A dds::ServiceServer each.
  std::vector<std::shared_ptr<void>> servers_;
};

}  // namespace stillmap::server
