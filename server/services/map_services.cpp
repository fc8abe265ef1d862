#include "server/services/map_services.hpp"

#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "idl/dds/service_server.hpp"
#include "server/services/service_handlers.hpp"
#include "server/threads/background_throttle.hpp"
#include "server/threads/thread_failure.hpp"
#include "server/threads/thread_name.hpp"

namespace stillmap::server {
namespace {

using Work = std::function<void()>;

/// Long answers do not hold up poses where the cores are busy: neither on this thread nor on
/// oneTBB's workers, which go to the mapper first.
dds::ServiceOptions in_background(const std::string& name) {
  return {.run = [name](const Work& work) {
    name_this_thread(name);
    static_cast<void>(use_scheduling(BackgroundScheduling::low));
    run_behind_the_mapper([&] { run_or_report(work); });
  }};
}

dds::ServiceOptions promptly(const std::string& name, PromptBudget& budget) {
  return {.run =
              [name](const Work& work) {
                name_this_thread(name);
                run_or_report(work);
              },
          .turn = [turns = std::make_shared<PromptTurns>(budget, name)](
                      const Work& work) { turns->run(work); }};
}

/// `handler`'s answer; where it may change something, only while `refuses_changes` has no reason.
template <typename Request, typename Reply>
std::function<Reply(const Request&)> guarded(const ServiceHandler<Request, Reply>& handler,
                                             const ServiceContext& context,
                                             MapServices::ChangeRefusal refuses_changes) {
  const auto answer = [&context, answer = handler.answer](const Request& request) {
    return answer(context, request);
  };
  if constexpr (dds::CarriesRefusal<Reply>) {
    return [&context, answer, spec = handler.spec,
            refuses = std::move(refuses_changes)](const Request& request) {
      const std::string reason = dds::asks_for_change(spec, request) ? refuses() : std::string();
      if (reason.empty()) return answer(request);
      Reply refusal;
      refusal.status(reply_status(*context.latest_map.view(), wire::ReplyCode::failed, reason));
      return refusal;
    };
  } else {
    return answer;
  }
}

}  // namespace

MapServices::MapServices(dds::Participant& participant, const std::string& name_space,
                         ServiceContext context, ChangeRefusal refuses_changes)
    : context_(std::move(context)) {
  for_each_handler(
      [&]<typename Request, typename Reply>(const ServiceHandler<Request, Reply>& handler) {
        const std::string name = handler.spec.in(name_space);
        auto answer = guarded(handler, context_, refuses_changes);
        const std::string thread_name(handler.spec.name);
        dds::ServiceOptions options = handler.urgency == AnswerUrgency::prompt
                                          ? promptly(thread_name, prompt_budget_)
                                          : in_background(thread_name);
        options.carries_out_once = handler.spec.effect == dds::ServiceEffect::modifies;
        options.idle = [this, idle = handler.idle] { idle(context_); };
        servers_.push_back(std::make_shared<dds::ServiceServer<Request, Reply>>(
            participant, name, logged(context_.log, name, std::move(answer)), std::move(options)));
      });
}

}  // namespace stillmap::server
