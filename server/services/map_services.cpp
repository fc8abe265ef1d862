#include "server/services/map_services.hpp"

#include <tbb/task_arena.h>

#include <functional>
#include <utility>

#include "idl/dds/service_server.hpp"
#include "server/services/service_handlers.hpp"
#include "server/threads/background_throttle.hpp"
#include "server/threads/thread_failure.hpp"

namespace stillmap::server {
namespace {

/// What clients ask for does not hold up poses where the cores are busy: neither on this thread nor
/// on oneTBB's workers, which go to the mapper first.
void run_service(const std::function<void()>& work) {
  static_cast<void>(use_scheduling(BackgroundScheduling::low));
  tbb::task_arena behind_the_mapper(tbb::task_arena::automatic, 1, tbb::task_arena::priority::low);
  behind_the_mapper.execute([&] { run_or_report(work); });
}

}  // namespace

MapServices::MapServices(dds::Participant& participant, const std::string& name_space,
                         ServiceContext context)
    : context_(std::move(context)) {
  for_each_handler([&]<typename Request, typename Reply>(
                       const ServiceHandler<Request, Reply>& handler) {
    const std::string name = handler.spec.in(name_space);
    auto answer = [this, answer = handler.answer](const Request& request) {
      return answer(context_, request);
    };
    servers_.push_back(std::make_shared<dds::ServiceServer<Request, Reply>>(
        participant, name, logged(context_.log, name, std::move(answer)),
        dds::ServiceOptions{.carries_out_once = handler.spec.effect == dds::ServiceEffect::modifies,
                            .idle = [this, idle = handler.idle] { idle(context_); },
                            .run = run_service}));
  });
}

}  // namespace stillmap::server
