#include "idl/interface/roles.hpp"

#include <gtest/gtest.h>

#include "idl/dds/service_identity.hpp"

namespace stillmap::dds {
namespace {

const TopicNames names{.points = "lidar/points", .odometry_prior = "odom", .name_space = "car_7"};

// Another reading of the lists: sizes that come from the structs themselves.
constexpr std::size_t topics = sizeof(Topics) / sizeof(TopicSpec<stillmap_msgs::msg::Status>);
constexpr std::size_t services = sizeof(Services) / sizeof(std::string);

TEST(RolesTest, KnowEveryTopicAndService) {
  EXPECT_EQ(published_topics("car_7").size(), topics);
  const ServiceNames found = service_names("car_7");
  EXPECT_EQ(found.reading.size() + found.changing.size(), services);
}

TEST(RolesTest, LetTheServerDoAllThatItDoes) {
  const Access server = access_of(Role::server, names);
  for (const std::string& topic : published_topics("car_7")) {
    EXPECT_TRUE(server.may_publish(topic)) << topic;
  }
  const ServiceNames found = service_names("car_7");
  for (const auto& list : {found.reading, found.changing}) {
    for (const std::string& service : list) {
      EXPECT_TRUE(server.may_publish(reply_topic(service))) << service;
      EXPECT_TRUE(server.may_subscribe(request_topic(service))) << service;
    }
  }
  EXPECT_TRUE(server.may_subscribe("rt/lidar/points"));
  EXPECT_TRUE(server.may_subscribe("rt/odom"));
}

TEST(RolesTest, LetAPlannerReadEverythingAndChangeNothing) {
  const Access planner = access_of(Role::planner, names);
  const Access boss = access_of(Role::operator_of_server, names);
  for (const std::string& topic : published_topics("car_7")) {
    EXPECT_TRUE(planner.may_subscribe(topic)) << topic;
    EXPECT_FALSE(planner.may_publish(topic)) << topic;
  }
  const ServiceNames found = service_names("car_7");
  for (const std::string& service : found.reading) {
    EXPECT_TRUE(planner.may_publish(request_topic(service))) << service;
    EXPECT_TRUE(planner.may_subscribe(reply_topic(service))) << service;
  }
  for (const std::string& service : found.changing) {
    EXPECT_FALSE(planner.may_publish(request_topic(service))) << service;
    EXPECT_TRUE(boss.may_publish(request_topic(service))) << service;
  }
  EXPECT_FALSE(planner.may_publish("rt/lidar/points"));
  EXPECT_FALSE(boss.may_publish("rt/lidar/points"));
}

TEST(RolesTest, LetASensorSendAndSeeHowItIsTaken) {
  const Access sensor = access_of(Role::sensor, names);
  EXPECT_TRUE(sensor.may_publish("rt/lidar/points"));
  EXPECT_TRUE(sensor.may_publish("rt/odom"));
  EXPECT_TRUE(sensor.may_subscribe("rt/car_7/status"));
  EXPECT_TRUE(sensor.may_publish(request_topic("car_7/get_status")));
  EXPECT_FALSE(sensor.may_publish(request_topic("car_7/reset")));
  EXPECT_FALSE(sensor.may_publish("rt/points"));
}

TEST(RolesTest, HaveNames) {
  EXPECT_EQ(role_from_name("operator"), Role::operator_of_server);
  EXPECT_EQ(role_from_name("planner"), Role::planner);
  EXPECT_FALSE(role_from_name("king"));
  EXPECT_EQ(role_names(), "server, sensor, planner, operator");
}

}  // namespace
}  // namespace stillmap::dds
