#include "idl/dds/dds_log.hpp"

#include <fastdds/dds/log/StdoutErrConsumer.hpp>
#include <memory>
#include <utility>

namespace stillmap::dds {

void log_dds_to_stderr() {
  using eprosima::fastdds::dds::Log;
  auto consumer = std::make_unique<eprosima::fastdds::dds::StdoutErrConsumer>();
  consumer->stderr_threshold(Log::Kind::Info);
  Log::ClearConsumers();
  Log::RegisterConsumer(std::move(consumer));
}

}  // namespace stillmap::dds
