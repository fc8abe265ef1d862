#include "clients/commands/server_control/status_report.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

namespace stillmap::cli {
namespace {

dds::ServerStatus with_counters() {
  dds::ServerStatus status;
  status.counters = {{"scans_received", "", 9},
                     {"scans_dropped", "queue_full", 3},
                     {"scans_dropped", "bad_cloud", 1},
                     {"bad_clouds", "no_xyz", 1}};
  return status;
}

TEST(StatusReport, GroupsCountersOfOneNameInJson) {
  const auto status = nlohmann::json::parse(status_json(with_counters()).dump());
  const auto expected = nlohmann::json::parse(
      R"({"scans_received": 9, "scans_dropped": {"bad_cloud": 1, "queue_full": 3},
          "bad_clouds": {"no_xyz": 1}})");
  EXPECT_EQ(status.at("counters"), expected);
}

TEST(StatusReport, ShowsWhatACounterIsOf) {
  EXPECT_THAT(status_text(with_counters()),
              testing::ContainsRegex("scans_dropped +queue_full +3\n"));
}

}  // namespace
}  // namespace stillmap::cli
