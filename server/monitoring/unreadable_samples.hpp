#pragma once

#include <string>

#include "idl/dds/reader.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"

namespace stillmap::server {

/// Samples of a topic that are none of its type: counted, and told once for each writer. One thread
/// uses it.
class UnreadableSamples {
 public:
  /// `topic` as the log names it, `event` as the status counts it.
  UnreadableSamples(std::string topic, std::string event, Statistics& statistics);

  /// Of those that the reader passed over since the last call.
  void report(dds::UntypedReader& reader);

 private:
  std::string topic_;
  std::string event_;
  Statistics& statistics_;
  NewLines told_;
};

}  // namespace stillmap::server
