#pragma once

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
  /// Throws DdsError when the topics cannot be made.
  MapServices(dds::Participant& participant, const std::string& name_space, ServiceContext context);

 private:
  ServiceContext context_;
  PromptBudget prompt_budget_;
  /// A dds::ServiceServer each.
  std::vector<std::shared_ptr<void>> servers_;
};

}  // namespace stillmap::server
