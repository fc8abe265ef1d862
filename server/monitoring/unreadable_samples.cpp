#include "server/monitoring/unreadable_samples.hpp"

#include <spdlog/spdlog.h>

#include <sstream>
#include <utility>

namespace stillmap::server {

UnreadableSamples::UnreadableSamples(std::string topic, std::string event, Statistics& statistics)
    : topic_(std::move(topic)), event_(std::move(event)), statistics_(statistics) {}

void UnreadableSamples::report(dds::UntypedReader& reader) {
  for (const dds::UnreadableSample& sample : reader.take_unreadable()) {
    statistics_.count(event_);
    std::ostringstream writer;
    writer << sample.identity.writer_guid();
    if (!told_.add(writer.str())) continue;
    spdlog::warn("samples on {} cannot be read, the first has {}; counted as {}", topic_,
                 sample.why, event_);
  }
}

}  // namespace stillmap::server
