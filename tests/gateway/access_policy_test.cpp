#include "clients/gateway/access_policy.hpp"

#include <gtest/gtest.h>

namespace stillmap::gateway {
namespace {

using enum AccessPolicy::Verdict;

RequestIdentity from(std::string_view host, std::string_view origin = {}) {
  return {.target = "/", .host = host, .origin = origin, .authorization = {}, .cookie = {}};
}

TEST(AccessPolicy, OnThisMachineAnswersUnderItsOwnNamesOnly) {
  const AccessPolicy policy(AccessOptions{});
  EXPECT_EQ(policy.judge(from("localhost:8765")), allowed);
  EXPECT_EQ(policy.judge(from("127.0.0.1:8765")), allowed);
  EXPECT_EQ(policy.judge(from("[::1]:8765")), allowed);
  EXPECT_EQ(policy.judge(from("127.0.0.2:8765")), allowed);
  EXPECT_EQ(policy.judge(from("127.0.0.1.evil.example:8765")), wrong_host);
  EXPECT_EQ(policy.judge(from("128.0.0.1:8765")), wrong_host);
  // A name that was made to lead here.
  EXPECT_EQ(policy.judge(from("evil.example:8765")), wrong_host);
  EXPECT_EQ(policy.judge(from("localhost.evil.example")), wrong_host);
  EXPECT_EQ(policy.judge(from("")), wrong_host);
}

TEST(AccessPolicy, LetsOurPageAndViewersConnectButNoOtherPage) {
  const AccessPolicy policy({.token = {}, .local_only = true, .origins = {"lab.example:8080"}});
  EXPECT_EQ(policy.judge(from("localhost:8765", "http://localhost:8765")), allowed);
  EXPECT_EQ(policy.judge(from("localhost:8765", "http://localhost:8080")), allowed);
  EXPECT_EQ(policy.judge(from("localhost:8765", "https://app.foxglove.dev")), allowed);
  EXPECT_EQ(policy.judge(from("localhost:8765", "file://")), allowed);
  EXPECT_EQ(policy.judge(from("localhost:8765", "https://lab.example:8080")), allowed);
  EXPECT_EQ(policy.judge(from("localhost:8765", "https://evil.example")), wrong_origin);
  EXPECT_EQ(policy.judge(from("localhost:8765", "https://app.foxglove.dev.evil.example")),
            wrong_origin);
  EXPECT_EQ(policy.judge(from("localhost:8765", "null")), wrong_origin);
}

TEST(AccessPolicy, AsksForTheTokenWhereThereIsOne) {
  const AccessPolicy policy({.token = "secret-secret-16", .local_only = false, .origins = {}});
  RequestIdentity request = from("robot.local:8765");
  EXPECT_EQ(policy.judge(request), no_token);
  request.target = "/?token=secret-secret-16";
  EXPECT_EQ(policy.judge(request), allowed);
  request.target = "/tiles/1/2/3?a=b&token=secret-secret-16";
  EXPECT_EQ(policy.judge(request), allowed);
  for (const auto* const wrong : {"/?token=secret-secret-17", "/?token=secret", "/?token=",
                                  "/?xtoken=secret-secret-16", "/token=secret-secret-16"}) {
    request.target = wrong;
    EXPECT_EQ(policy.judge(request), no_token) << wrong;
  }
  request.target = "/";
  request.authorization = "Bearer secret-secret-16";
  EXPECT_EQ(policy.judge(request), allowed);
  request.authorization = "Basic secret-secret-16";
  EXPECT_EQ(policy.judge(request), no_token);
}

TEST(AccessPolicy, ACookieServesOurPageAlone) {
  const AccessPolicy policy({.token = "secret-secret-16", .local_only = false, .origins = {}});
  const auto cookie = policy.cookie_for("/?token=secret-secret-16", true);
  ASSERT_TRUE(cookie);
  EXPECT_NE(cookie->find("HttpOnly; SameSite=Strict; Secure"), std::string::npos);
  EXPECT_FALSE(policy.cookie_for("/?token=wrong", true));
  EXPECT_FALSE(policy.cookie_for("/", true));
  RequestIdentity request = from("robot.local", "https://robot.local");
  request.cookie = "a=b; stillmap_token=secret-secret-16";
  EXPECT_EQ(policy.judge(request), allowed);
  request.origin = "https://evil.example";
  EXPECT_EQ(policy.judge(request), wrong_origin);
}

TEST(AccessPolicy, KnowsWhichAddressesOthersReach) {
  EXPECT_TRUE(is_local_address("127.0.0.1:8765"));
  EXPECT_TRUE(is_local_address("[::1]:8765"));
  EXPECT_FALSE(is_local_address("0.0.0.0:8765"));
  EXPECT_FALSE(is_local_address("[::]:8765"));
  EXPECT_FALSE(is_local_address("192.168.1.2:8765"));
}

}  // namespace
}  // namespace stillmap::gateway
