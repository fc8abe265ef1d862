#include "idl/dds/dds_log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fastdds/dds/log/Log.hpp>

namespace stillmap::dds {
namespace {

TEST(DdsLog, StaysOutOfWhatAProgramPrints) {
  log_dds_to_stderr();
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  EPROSIMA_LOG_ERROR(STILLMAP, "a socket is full");
  eprosima::fastdds::dds::Log::Flush();
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  EXPECT_THAT(testing::internal::GetCapturedStderr(), testing::HasSubstr("a socket is full"));
}

}  // namespace
}  // namespace stillmap::dds
