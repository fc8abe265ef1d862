#include "idl/interface/participant_diagnostics.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/doctor/make_endpoint.hpp"

namespace stillmap {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

Peer peer(const std::string& name) {
  Peer made;
  made.guid = made.name = name;
  made.is_on_this_host = made.uses_shared_memory = true;
  made.endpoints = {test::end("rt/tf", "tf2_msgs::msg::dds_::TFMessage_", true)};
  return made;
}

auto says(const std::string& what) { return Field(&Finding::what, HasSubstr(what)); }

TEST(PeerFindingsTest, AreNoneWhereAllIsWell) {
  EXPECT_THAT(security_findings(peer("self"), {peer("lidar")}), IsEmpty());
  EXPECT_THAT(silent_peer_findings(peer("self"), {peer("lidar")}), IsEmpty());
}

TEST(PeerFindingsTest, TellWhichSideLacksSecurity) {
  Peer secured = peer("server");
  secured.is_secured = true;
  EXPECT_THAT(security_findings(peer("self"), {secured}),
              ElementsAre(AllOf(says("server is secured and self is not"),
                                Field(&Finding::way_out, HasSubstr("--security")))));
  EXPECT_THAT(security_findings(secured, {peer("lidar")}),
              ElementsAre(says("lidar is not secured and is ignored")));
  Peer refused = secured;
  refused.refused = true;
  EXPECT_THAT(security_findings(secured, {refused}), ElementsAre(says("refuse each other")));
  EXPECT_THAT(security_findings(secured, {secured}), IsEmpty());
}

TEST(PeerFindingsTest, BlameSharedMemoryForASilentPeerOnThisHost) {
  Peer silent = peer("server");
  silent.endpoints.clear();
  EXPECT_THAT(silent_peer_findings(peer("self"), {silent}),
              ElementsAre(Field(&Finding::way_out, HasSubstr("--udp-only"))));
  silent.is_on_this_host = false;
  EXPECT_THAT(silent_peer_findings(peer("self"), {silent}),
              ElementsAre(Field(&Finding::way_out, HasSubstr("firewalls"))));
  silent.is_secured = true;
  EXPECT_THAT(silent_peer_findings(peer("self"), {silent}), IsEmpty());
}

TEST(PeerFindingsTest, SayEachMismatchOnceWithItsRemedy) {
  const Mismatch mismatch{.topic = "rt/points",
                          .writer = {},
                          .reader = {},
                          .writer_peer = peer("lidar"),
                          .reader_peer = peer("server"),
                          .obstacles = {"reliability: x", "durability: y"}};
  const auto findings = mismatch_findings({mismatch, mismatch});
  ASSERT_THAT(findings, SizeIs(1));
  EXPECT_EQ(findings[0].what, "rt/points: what lidar writes does not reach server");
  EXPECT_THAT(findings[0].way_out, AllOf(HasSubstr("best effort"), HasSubstr("transient local")));
  Mismatch harmless = mismatch;
  harmless.topic = "ros_discovery_info";
  EXPECT_EQ(finding_of(harmless).severity, Severity::advice);
}

}  // namespace
}  // namespace stillmap
