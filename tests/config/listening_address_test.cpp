#include "config/loaders/listening_address.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "config/loaders/server_config.hpp"
#include "tests/config/config_files.hpp"

namespace stillmap {
namespace {

using testing::HasSubstr;

TEST(ListeningAddress, IsAnIpAddressAndAPort) {
  for (const char* address : {"127.0.0.1:9464", "0.0.0.0:1", "10.0.0.7:65535", "[::1]:80",
                              "[fe80::1]:9464", "127.0.0.1:0"}) {
    EXPECT_EQ(listening_address_fault(address), "") << address;
  }
}

TEST(ListeningAddress, NothingElseIs) {
  for (const char* address :
       {"", ":", "9464", ":9464", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:-1",
        "127.0.0.1:1x", "host:9464", "::1:9464", "[::1:9464", "[]:9464", "300.0.0.1:9464",
        "127.0.0.1:9464s", "+:80"}) {
    EXPECT_THAT(listening_address_fault(address), HasSubstr("'" + std::string(address) + "'"));
  }
}

TEST(ListeningAddress, IsCheckedWithTheServersOtherFields) {
  const std::string faults = test::refusal([] {
    static_cast<void>(load_server_config(
        test::write_file("server.yaml", "metrics: {address: here}\nlog: {level: loud}\n")));
  });
  EXPECT_THAT(faults, testing::AllOf(HasSubstr("metrics.address"), HasSubstr("'here'"),
                                     HasSubstr("log.level"), HasSubstr("warning")));
}

}  // namespace
}  // namespace stillmap
