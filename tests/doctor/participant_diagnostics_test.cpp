#include "idl/interface/participant_diagnostics.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/doctor/make_endpoint.hpp"

namespace stillmap::cli {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

dds::RemoteParticipant participant(const std::string& name) {
  dds::RemoteParticipant made;
  made.guid = made.name = name;
  made.is_on_this_host = made.uses_shared_memory = true;
  made.endpoints = {test::make_endpoint("rt/tf", "tf2_msgs::msg::dds_::TFMessage_", true)};
  return made;
}

auto tells(const std::string& what) { return Field(&dds::Diagnostic::what, HasSubstr(what)); }

TEST(ParticipantDiagnosticsTest, AreNoneWhereAllIsWell) {
  EXPECT_THAT(dds::security_diagnostics(participant("self"), {participant("lidar")}), IsEmpty());
  EXPECT_THAT(dds::silent_participant_diagnostics(participant("self"), {participant("lidar")}),
              IsEmpty());
}

TEST(ParticipantDiagnosticsTest, TellWhichSideLacksSecurity) {
  dds::RemoteParticipant secured = participant("server");
  secured.is_secured = true;
  EXPECT_THAT(dds::security_diagnostics(participant("self"), {secured}),
              ElementsAre(AllOf(tells("server is secured and self is not"),
                                Field(&dds::Diagnostic::hint, HasSubstr("--security")))));
  EXPECT_THAT(dds::security_diagnostics(secured, {participant("lidar")}),
              ElementsAre(tells("lidar is not secured and is ignored")));
  dds::RemoteParticipant refused = secured;
  refused.refused = true;
  EXPECT_THAT(dds::security_diagnostics(secured, {refused}),
              ElementsAre(tells("refuse each other")));
  dds::RemoteParticipant unauthenticated = secured;
  unauthenticated.unauthenticated = true;
  EXPECT_THAT(dds::security_diagnostics(secured, {unauthenticated}),
              ElementsAre(AllOf(tells("have not authenticated each other"),
                                Field(&dds::Diagnostic::hint, HasSubstr("restart one")))));
  EXPECT_THAT(dds::security_diagnostics(secured, {secured}), IsEmpty());
}

TEST(ParticipantDiagnosticsTest, AreNotAboutADoctorThatLooksIn) {
  dds::RemoteParticipant survey = participant(dds::survey_participant);
  survey.endpoints.clear();
  dds::RemoteParticipant secured = participant("server");
  secured.is_secured = true;
  EXPECT_THAT(dds::security_diagnostics(secured, {survey}), IsEmpty());
  EXPECT_THAT(dds::silent_participant_diagnostics(participant("self"), {survey}), IsEmpty());
}

TEST(ParticipantDiagnosticsTest, AreNotAboutADiscoveryServerWhichHasNoTopics) {
  dds::RemoteParticipant server = participant("stillmap");
  server.endpoints.clear();
  for (const char* const id : {"00", "1f"}) {
    server.guid = std::string("44.53.") + id + ".5f.45.50.52.4f.53.49.4d.41";
    for (const char* const address : {"10.0.0.5", "127.0.0.1"}) {
      server.addresses = {address};
      EXPECT_THAT(dds::silent_participant_diagnostics(participant("self"), {server}), IsEmpty());
    }
  }
}

TEST(ParticipantDiagnosticsTest, BlameSharedMemoryForASilentPeerOnThisHost) {
  dds::RemoteParticipant silent = participant("server");
  silent.endpoints.clear();
  EXPECT_THAT(dds::silent_participant_diagnostics(participant("self"), {silent}),
              ElementsAre(Field(&dds::Diagnostic::hint, HasSubstr("--udp-only"))));
  silent.is_on_this_host = false;
  EXPECT_THAT(dds::silent_participant_diagnostics(participant("self"), {silent}),
              ElementsAre(Field(&dds::Diagnostic::hint, HasSubstr("firewalls"))));
  silent.addresses = {"127.0.0.1"};
  EXPECT_THAT(dds::silent_participant_diagnostics(participant("self"), {silent}),
              ElementsAre(Field(&dds::Diagnostic::hint, HasSubstr("--dds-profile host"))));
  dds::RemoteParticipant beside = participant("self");
  beside.addresses = {"127.0.0.1"};
  EXPECT_THAT(dds::silent_participant_diagnostics(beside, {silent}),
              ElementsAre(Field(&dds::Diagnostic::hint, HasSubstr("firewalls"))));
  silent.is_secured = true;
  EXPECT_THAT(dds::silent_participant_diagnostics(participant("self"), {silent}), IsEmpty());
  dds::RemoteParticipant secured = participant("self");
  secured.is_secured = silent.unauthenticated = true;
  EXPECT_THAT(dds::silent_participant_diagnostics(secured, {silent}), IsEmpty());
}

TEST(ParticipantDiagnosticsTest, NameOtherServersOfAName) {
  const std::string reply = "stillmap_msgs::srv::dds_::GetStatus_Response_";
  const std::string request = "stillmap_msgs::srv::dds_::GetStatus_Request_";
  dds::RemoteParticipant other = participant("other");
  other.process = "12";
  other.endpoints = {test::make_endpoint("rr/stillmap/get_statusReply", reply, true)};
  dds::RemoteParticipant of_another_name = participant("of_another_name");
  of_another_name.endpoints = {test::make_endpoint("rr/upstairs/get_statusReply", reply, true)};
  dds::RemoteParticipant client = participant("client");
  client.endpoints = {test::make_endpoint("rr/stillmap/get_statusReply", reply, false),
                      test::make_endpoint("rq/stillmap/get_statusRequest", request, true)};
  const auto found = dds::servers_called("stillmap", {client, of_another_name, other});
  EXPECT_THAT(dds::namesake_diagnostics("stillmap", found),
              ElementsAre(tells("another server is called 'stillmap' (this host, process 12)")));
}

TEST(ParticipantDiagnosticsTest, SayEachMismatchOnceWithItsRemedy) {
  const dds::RemoteParticipant lidar = participant("lidar"), server = participant("server");
  const dds::Mismatch mismatch{.topic = "rt/points",
                               .writer_participant = &lidar,
                               .reader_participant = &server,
                               .incompatible_policies = {"reliability: x", "durability: y"}};
  const auto diagnostics =
      dds::mismatch_diagnostics({.found = {mismatch, mismatch}, .left_out = 0});
  ASSERT_THAT(diagnostics, SizeIs(1));
  EXPECT_EQ(diagnostics[0].what, "rt/points: what lidar writes does not reach server");
  EXPECT_THAT(diagnostics[0].hint, AllOf(HasSubstr("best effort"), HasSubstr("transient local")));
  dds::Mismatch harmless = mismatch;
  harmless.topic = "ros_discovery_info";
  EXPECT_EQ(dds::to_diagnostic(harmless).severity, dds::Severity::advice);
  EXPECT_THAT(dds::mismatch_diagnostics({.found = {mismatch}, .left_out = 9}).back(), tells("9"));
}

/// A publisher on this host, and the server.
std::vector<dds::RemoteParticipant> lidar(bool reliable) {
  dds::RemoteParticipant made = participant("lidar");
  made.endpoints.push_back(
      test::make_endpoint("rt/points", "sensor_msgs::msg::dds_::PointCloud2_", true));
  made.endpoints.back().guid = "writer of clouds";
  made.endpoints.back().qos.reliable = reliable;
  return {made};
}

TEST(LostScans, AreExplainedByWhatThePublisherOffersAndHowItSends) {
  const dds::RemoteParticipant server = participant("server");
  const dds::ScanLosses few{.writer_guid = "writer of clouds", .received = 90, .lost = 10};
  const auto reliable = dds::lost_scans_diagnostic("rt/points", few, server, lidar(true));
  EXPECT_EQ(reliable.severity, dds::Severity::advice);
  EXPECT_THAT(reliable, tells("scans of lidar get lost"));
  EXPECT_THAT(reliable.evidence, HasSubstr("10 of its last 100"));
  EXPECT_THAT(reliable.hint, AllOf(HasSubstr("keep last 5"), HasSubstr("segment_size")));
  const auto best_effort = dds::lost_scans_diagnostic("rt/points", few, server, lidar(false));
  EXPECT_THAT(best_effort.hint, HasSubstr("offer reliable"));
  dds::RemoteParticipant over_udp = server;
  over_udp.uses_shared_memory = false;
  EXPECT_THAT(dds::lost_scans_diagnostic("rt/points", few, over_udp, lidar(false)).hint,
              HasSubstr("net.core.rmem_max"));
  const dds::ScanLosses most{.writer_guid = "gone", .received = 1, .lost = 3};
  const auto unknown = dds::lost_scans_diagnostic("rt/points", most, server, {});
  EXPECT_EQ(unknown.severity, dds::Severity::problem);
  EXPECT_THAT(unknown, tells("scans of a publisher get lost"));
}

TEST(SeveralPublishers, AreNamedWhereTheyAreKnown) {
  const auto two =
      dds::several_publishers_diagnostic("rt/points", {"writer of clouds", "gone"}, lidar(true));
  EXPECT_EQ(two.severity, dds::Severity::problem);
  EXPECT_THAT(two, tells("2 publishers send scans in turns"));
  EXPECT_THAT(two.evidence, AllOf(HasSubstr("lidar"), HasSubstr("unknown")));
  EXPECT_THAT(two.hint, HasSubstr("'sensors'"));
}

}  // namespace
}  // namespace stillmap::cli
