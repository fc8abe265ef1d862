#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/publishers/namesakes.hpp"

namespace stillmap::server {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::Field;
using testing::IsEmpty;

std::vector<dds::RemoteParticipant> servers(const std::vector<std::string>& guids) {
  std::vector<dds::RemoteParticipant> all;
  for (const std::string& guid : guids) all.emplace_back().guid = guid;
  return all;
}

auto is(const std::string& guid) { return Field(&dds::RemoteParticipant::guid, guid); }

constexpr NamesakeRecord::TimePoint begin{1h};

TEST(NamesakeRecordTest, OneCountsAtOnceUntilItIsAskedInVain) {
  NamesakeRecord record(0s);
  EXPECT_FALSE(record.knows_any());
  EXPECT_THAT(record.there(servers({"a", "b"}), begin), ElementsAre(is("a"), is("b")));
  EXPECT_TRUE(record.knows_any());
  for (int question = 1; question < NamesakeRecord::max_vain_questions; ++question) {
    record.add_answers({"b"});
    EXPECT_THAT(record.there(servers({"a", "b"}), begin), ElementsAre(is("a"), is("b")));
  }
  record.add_answers({"b"});
  EXPECT_THAT(record.there(servers({"a", "b"}), begin), ElementsAre(is("b")));
  // It was only busy.
  record.add_answers({"a", "b"});
  EXPECT_THAT(record.there(servers({"a", "b"}), begin), ElementsAre(is("a"), is("b")));
}

TEST(NamesakeRecordTest, OneThatMayBeDeadCountsFromItsFirstAnswerOn) {
  NamesakeRecord record(12s);
  EXPECT_THAT(record.there(servers({"dead", "alive"}), begin), IsEmpty());
  record.add_answers({"alive"});
  EXPECT_THAT(record.there(servers({"dead", "alive"}), begin + 1s), ElementsAre(is("alive")));
  record.add_answers({"alive"});
  record.add_answers({"alive"});
  EXPECT_THAT(record.there(servers({"dead", "alive"}), begin + 20s), ElementsAre(is("alive")));
}

TEST(NamesakeRecordTest, OneThatCannotBeAskedCountsAfterTheLeaseOfTheDead) {
  NamesakeRecord record(12s);
  EXPECT_THAT(record.there(servers({"a"}), begin), IsEmpty());
  EXPECT_THAT(record.there(servers({"a"}), begin + 11s), IsEmpty());
  EXPECT_THAT(record.there(servers({"a"}), begin + 12s), ElementsAre(is("a")));
}

TEST(NamesakeRecordTest, ForgetsWhomDiscoveryForgot) {
  NamesakeRecord record(0s);
  ASSERT_THAT(record.there(servers({"a"}), begin), ElementsAre(is("a")));
  for (int question = 0; question < NamesakeRecord::max_vain_questions; ++question)
    record.add_answers({});
  ASSERT_THAT(record.there(servers({"a"}), begin), IsEmpty());
  EXPECT_THAT(record.there({}, begin), IsEmpty());
  EXPECT_FALSE(record.knows_any());
  EXPECT_THAT(record.there(servers({"a"}), begin), ElementsAre(is("a")));
}

}  // namespace
}  // namespace stillmap::server
