#include "idl/dds/message_definition.hpp"

#include <gmock/gmock.h>

#include <regex>
#include <set>
#include <string>

#include "idl/dds/type_support.hpp"
#include "idl/interface/services.hpp"
#include "idl/interface/topics.hpp"
#include "sensor_msgs.h"
#include "submaps.h"
#include "tf2_msgs.h"

namespace stillmap::dds {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

/// Names under "MSG: ", and a fault of the test for one that comes twice.
std::set<std::string> defined_in(const std::string& definition) {
  std::set<std::string> names;
  const std::regex pattern("={80}\nMSG: (\\w+/\\w+)\n");
  for (std::sregex_iterator at(definition.begin(), definition.end(), pattern), end; at != end;
       ++at) {
    EXPECT_TRUE(names.insert((*at)[1]).second) << (*at)[1] << " is defined twice";
  }
  return names;
}

std::set<std::string> used_in(const std::string& definition) {
  std::set<std::string> names;
  const std::regex pattern("\n(\\w+/\\w+)(\\[\\d*\\])? \\w+(?=\n)");
  const std::string text = "\n" + definition;
  for (std::sregex_iterator at(text.begin(), text.end(), pattern), end; at != end; ++at) {
    names.insert((*at)[1]);
  }
  return names;
}

void expect_self_contained(const std::string& ros_type) {
  const std::string definition = message_definition(ros_type);
  EXPECT_FALSE(definition.empty()) << ros_type;
  EXPECT_EQ(defined_in(definition), used_in(definition)) << ros_type;
}

TEST(MessageDefinition, HasTheFieldsAndThenTheTypesThatTheyUse) {
  EXPECT_EQ(message_definition("std_msgs/msg/Header"),
            "builtin_interfaces/Time stamp\nstring frame_id\n" + std::string(80, '=') +
                "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n");
}

TEST(MessageDefinition, OfATypeWithoutOthersIsItsFieldsAlone) {
  EXPECT_EQ(message_definition("geometry_msgs/msg/Point"), "float64 x\nfloat64 y\nfloat64 z\n");
}

TEST(MessageDefinition, NamesArraysAndSignsAsRosDoes) {
  EXPECT_THAT(message_definition("geometry_msgs/msg/PoseWithCovariance"),
              HasSubstr("float64[36] covariance\n"));
  EXPECT_THAT(message_definition("nav_msgs/msg/OccupancyGrid"), HasSubstr("int8[] data\n"));
  EXPECT_THAT(message_definition("nav_msgs/srv/GetMap_Response"),
              StartsWith("nav_msgs/OccupancyGrid map\n"));
}

TEST(MessageDefinition, EveryTopicHasOneThatNeedsNoOther) {
  for_each_topic(Topics::in("stillmap"), []<typename T>(const TopicSpec<T>&) {
    expect_self_contained(ros_type_name(type_support<T>()));
  });
}

TEST(MessageDefinition, EveryServiceHasOneThatNeedsNoOther) {
  for_each_service([]<typename Request, typename Reply>(const ServiceSpec<Request, Reply>&) {
    expect_self_contained(ros_type_name(type_support<Request>()));
    expect_self_contained(ros_type_name(type_support<Reply>()));
  });
}

TEST(MessageDefinition, OfAnUnknownTypeIsEmpty) {
  EXPECT_EQ(message_definition("nav_msgs/msg/Odometr"), "");
  EXPECT_EQ(message_definition("nav_msgs/Odometry"), "");
  EXPECT_EQ(message_definition(""), "");
}

}  // namespace
}  // namespace stillmap::dds
