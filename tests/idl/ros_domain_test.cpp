#include "idl/dds/ros_domain.hpp"

#include <gtest/gtest.h>
#include <stdlib.h>

#include "idl/dds/dds_error.hpp"

namespace stillmap::dds {
namespace {

TEST(RosDomainTest, IsThatOfTheEnvironment) {
  unsetenv("ROS_DOMAIN_ID");
  EXPECT_EQ(ros_domain_id(), 0U);
  setenv("ROS_DOMAIN_ID", "", 1);
  EXPECT_EQ(ros_domain_id(), 0U);
  setenv("ROS_DOMAIN_ID", "42", 1);
  EXPECT_EQ(ros_domain_id(), 42U);
  for (const char* fault : {"233", "-1", "7 ", "robot"}) {
    setenv("ROS_DOMAIN_ID", fault, 1);
    EXPECT_THROW(static_cast<void>(ros_domain_id()), DdsError) << fault;
  }
  unsetenv("ROS_DOMAIN_ID");
}

}  // namespace
}  // namespace stillmap::dds
