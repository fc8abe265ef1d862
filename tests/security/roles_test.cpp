#include "idl/interface/roles.hpp"

#include <gtest/gtest.h>

#include "idl/dds/service_identity.hpp"
#include "idl/interface/services.hpp"
#include "idl/interface/topics.hpp"

namespace stillmap::dds {
namespace {

const TopicNames names{.points = {"lidar/points"},
                       .odometry_prior = "odom",
                       .imu = "imu",
                       .initial_pose = "set_pose",
                       .name_space = "car_7"};

// Another reading of the list: a size that comes from the struct itself.
constexpr std::size_t topic_count = sizeof(Topics) / sizeof(TopicSpec<stillmap_msgs::msg::Status>);

TEST(RolesTest, KnowEveryTopic) { EXPECT_EQ(published_topics("car_7").size(), topic_count); }

TEST(RolesTest, LetTheServerDoAllThatItDoes) {
  const Access server = access_of(Role::server, names);
  for (const std::string& topic : published_topics("car_7")) {
    EXPECT_TRUE(server.may_publish(topic)) << topic;
  }
  for_each_service([&](const auto& spec) {
    const std::string service = spec.in("car_7");
    EXPECT_TRUE(server.may_publish(reply_topic(service))) << service;
    EXPECT_TRUE(server.may_subscribe(request_topic(service))) << service;
  });
  EXPECT_TRUE(server.may_subscribe("rt/lidar/points"));
  EXPECT_TRUE(server.may_subscribe("rt/odom"));
  EXPECT_TRUE(server.may_subscribe("rt/tf_static"));
  EXPECT_TRUE(server.may_subscribe("rt/imu"));
  EXPECT_TRUE(server.may_subscribe("rt/set_pose"));
  EXPECT_FALSE(server.may_publish("rt/set_pose"));
}

TEST(RolesTest, LetAPlannerReadEverythingAndChangeNothing) {
  const Access planner = access_of(Role::planner, names);
  const Access boss = access_of(Role::operator_of_server, names);
  for (const std::string& topic : published_topics("car_7")) {
    EXPECT_TRUE(planner.may_subscribe(topic)) << topic;
    EXPECT_FALSE(planner.may_publish(topic)) << topic;
  }
  for_each_service([&](const auto& spec) {
    const std::string service = spec.in("car_7");
    const bool reads = spec.effect == ServiceEffect::reads;
    EXPECT_EQ(planner.may_publish(request_topic(service)), reads) << service;
    EXPECT_EQ(planner.may_subscribe(reply_topic(service)), reads) << service;
    EXPECT_TRUE(boss.may_publish(request_topic(service))) << service;
  });
  for (const char* service : {"save_map", "load_map", "reset", "restore_removed", "localize"}) {
    EXPECT_FALSE(planner.may_publish(request_topic(std::string("car_7/") + service))) << service;
  }
  EXPECT_FALSE(planner.may_publish("rt/lidar/points"));
  EXPECT_FALSE(boss.may_publish("rt/lidar/points"));
  EXPECT_FALSE(planner.may_publish("rt/set_pose"));
  EXPECT_TRUE(boss.may_publish("rt/goal_pose"));
  EXPECT_TRUE(planner.may_subscribe("rt/goal_pose"));
  EXPECT_FALSE(planner.may_publish("rt/goal_pose"));
  EXPECT_TRUE(planner.may_subscribe("rt/set_pose"));
  EXPECT_TRUE(boss.may_publish("rt/set_pose"));
}

TEST(RolesTest, LetASensorSendAndSeeHowItIsTaken) {
  const Access sensor = access_of(Role::sensor, names);
  EXPECT_TRUE(sensor.may_publish("rt/lidar/points"));
  EXPECT_TRUE(sensor.may_publish("rt/odom"));
  EXPECT_TRUE(sensor.may_publish("rt/tf_static"));
  EXPECT_TRUE(sensor.may_publish("rt/imu"));
  EXPECT_TRUE(sensor.may_subscribe("rt/car_7/status"));
  EXPECT_TRUE(sensor.may_publish(request_topic("car_7/get_status")));
  EXPECT_FALSE(sensor.may_publish(request_topic("car_7/reset")));
  EXPECT_FALSE(sensor.may_publish("rt/points"));
  EXPECT_FALSE(sensor.may_publish("rt/set_pose"));
}

TEST(RolesTest, HaveNames) {
  EXPECT_EQ(role_from_name("operator"), Role::operator_of_server);
  EXPECT_EQ(role_from_name("planner"), Role::planner);
  EXPECT_FALSE(role_from_name("king"));
  EXPECT_EQ(role_names(), "server, sensor, planner, operator");
}

TEST(RolesTest, KnowTheTopicsOfSeveralLidars) {
  const TopicNames two{.points = {"front/points", "rear/points"}};
  const Access server = access_of(Role::server, two);
  const Access sensor = access_of(Role::sensor, two);
  for (const std::string topic : {"rt/front/points", "rt/rear/points"}) {
    EXPECT_TRUE(server.may_subscribe(topic)) << topic;
    EXPECT_FALSE(server.may_publish(topic)) << topic;
    EXPECT_TRUE(sensor.may_publish(topic)) << topic;
    for (const Role role : {Role::planner, Role::operator_of_server}) {
      EXPECT_TRUE(access_of(role, two).may_subscribe(topic)) << topic;
      EXPECT_FALSE(access_of(role, two).may_publish(topic)) << topic;
    }
  }
  EXPECT_FALSE(server.may_subscribe("rt/points"));
  EXPECT_FALSE(sensor.may_publish("rt/points"));
}

}  // namespace
}  // namespace stillmap::dds
