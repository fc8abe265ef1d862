// A server that keeps its map in no file.

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "core/map/storage/map_file.hpp"
#include "tests/idl/dds_fixture.hpp"
#include "tests/server/room_scans.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

namespace fs = std::filesystem;

TEST(NoMapFile, ALoadDoesNotCostTheRunningMap) {
  const ServiceSetup setup("every");
  const fs::path folder = setup.map_file().parent_path();
  std::ofstream(folder / "none.yaml")
      << "sensor: vlp_16\ndds: {domain_id: " << dds::test_domain_id()
      << ", interfaces: [127.0.0.1]}\ninput: {delivery: every}\n";
  const fs::path here = fs::current_path();
  fs::current_path(folder);
  const ServerProcess server({"--config", (folder / "none.yaml").string(), "--domain",
                              std::to_string(dds::test_domain_id())});
  Client client(setup.client());
  client.wait_for_server(patience);
  fs::current_path(here);
  ScanPublisher publisher(setup.publisher(true));
  drive(publisher, 0, 4);
  ASSERT_TRUE(wait_for_scans(client, 4));
  const auto refusal = [&](const char* name) -> std::string {
    try {
      client.load_map(name);
    } catch (const ServiceError& error) {
      return error.what();
    }
    return "not refused";
  };
  client.save_map("first.stillmap");
  client.reset();
  drive(publisher, 4, 8);
  ASSERT_TRUE(wait_for_scans(client, 8));
  EXPECT_THAT(refusal("first.stillmap"), testing::HasSubstr("stillmap save NAME"));
  EXPECT_THROW(client.reset(), ServiceError);
  EXPECT_EQ(open_map_file(client.save_map("second.stillmap"))->load().trajectory.size(), 4U);
  EXPECT_THAT(refusal("third.stillmap"), testing::HasSubstr("in the folder " + folder.string()));
  EXPECT_EQ(client.load_map("first.stillmap").pose_count, 4U);
}

}  // namespace
}  // namespace stillmap::test
