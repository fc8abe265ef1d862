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
  EXPECT_THAT(record.known(), IsEmpty());
  EXPECT_THAT(record.there(servers({"a", "b"}), begin), ElementsAre(is("a"), is("b")));
  EXPECT_THAT(record.known(), ElementsAre("a", "b"));
  for (int question = 1; question < NamesakeRecord::max_vain_questions; ++question) {
    record.add_answers(record.known(), {"b"});
    EXPECT_THAT(record.there(servers({"a", "b"}), begin), ElementsAre(is("a"), is("b")));
  }
  record.add_answers(record.known(), {"b"});
  EXPECT_THAT(record.there(servers({"a", "b"}), begin), ElementsAre(is("b")));
  // It was only busy.
  record.add_answers(record.known(), {"a", "b"});
  EXPECT_THAT(record.there(servers({"a", "b"}), begin), ElementsAre(is("a"), is("b")));
}

TEST(NamesakeRecordTest, OneThatMayBeDeadCountsFromItsFirstAnswerOn) {
  NamesakeRecord record(12s);
  EXPECT_THAT(record.there(servers({"dead", "alive"}), begin), IsEmpty());
  record.add_answers(record.known(), {"alive"});
  EXPECT_THAT(record.there(servers({"dead", "alive"}), begin + 1s), ElementsAre(is("alive")));
  record.add_answers(record.known(), {"alive"});
  record.add_answers(record.known(), {"alive"});
  EXPECT_THAT(record.there(servers({"dead", "alive"}), begin + 20s), ElementsAre(is("alive")));
}

TEST(NamesakeRecordTest, OneThatCannotBeAskedCountsAfterTheLeaseOfTheDead) {
  NamesakeRecord record(12s);
  EXPECT_THAT(record.there(servers({"a"}), begin), IsEmpty());
  EXPECT_THAT(record.there(servers({"a"}), begin + 11s), IsEmpty());
  EXPECT_THAT(record.there(servers({"a"}), begin + 12s), ElementsAre(is("a")));
}

TEST(NamesakeRecordTest, OneThatCameDuringAQuestionWasNotAsked) {
  NamesakeRecord record(0s);
  for (int question = 0; question <= NamesakeRecord::max_vain_questions; ++question) {
    const std::vector<std::string> asked = record.known();
    ASSERT_THAT(record.there(servers({"late"}), begin), ElementsAre(is("late")));
    record.add_answers(asked, {});
  }
  EXPECT_THAT(record.there(servers({"late"}), begin), IsEmpty());
}

TEST(NamesakeRecordTest, ForgetsWhomDiscoveryForgot) {
  NamesakeRecord record(0s);
  ASSERT_THAT(record.there(servers({"a"}), begin), ElementsAre(is("a")));
  for (int question = 0; question < NamesakeRecord::max_vain_questions; ++question)
    record.add_answers(record.known(), {});
  ASSERT_THAT(record.there(servers({"a"}), begin), IsEmpty());
  EXPECT_THAT(record.there({}, begin), IsEmpty());
  EXPECT_THAT(record.known(), IsEmpty());
  EXPECT_THAT(record.there(servers({"a"}), begin), ElementsAre(is("a")));
}

}  // namespace
}  // namespace stillmap::server
