#include "idl/dds/security/documents.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace stillmap::dds {
namespace {

using ::testing::ElementsAre;

TEST(PermissionsTest, SurviveTheirText) {
  const Permissions written{.subject = "CN=arm,OU=planner,O=Stillmap",
                            .validity = Validity::days_from_now(5),
                            .access = {.publish = {"rq/a", "rq/b*"}, .subscribe = {"rt/points"}}};
  const auto read = permissions_from_text(to_text(written));
  ASSERT_TRUE(read);
  EXPECT_EQ(read->subject, written.subject);
  EXPECT_EQ(read->validity.from, written.validity.from);
  EXPECT_EQ(read->validity.to, written.validity.to);
  EXPECT_THAT(read->access.publish, ElementsAre("rq/a", "rq/b*"));
  EXPECT_THAT(read->access.subscribe, ElementsAre("rt/points"));
}

TEST(PermissionsTest, OfAnotherKindOfTextAreNone) {
  EXPECT_FALSE(permissions_from_text(""));
  EXPECT_FALSE(permissions_from_text(governance_text()));
  const std::string text =
      to_text(Permissions{.subject = "CN=a", .validity = Validity::days_from_now(1), .access = {}});
  EXPECT_FALSE(permissions_from_text(text + text));
  EXPECT_FALSE(permissions_from_text(text.substr(0, text.find("<not_after>") + 15)));
}

TEST(AccessTest, FollowsTheExpressions) {
  const Access access{.publish = {"rt/points", "rq/stillmap/get_*"}, .subscribe = {}};
  EXPECT_TRUE(access.may_publish("rt/points"));
  EXPECT_TRUE(access.may_publish("rq/stillmap/get_statusRequest"));
  EXPECT_FALSE(access.may_publish("rq/stillmap/resetRequest"));
  EXPECT_FALSE(access.may_publish("rt/points2"));
  EXPECT_FALSE(access.may_subscribe("rt/points"));
}

}  // namespace
}  // namespace stillmap::dds
