#include "server/monitoring/publisher_turns.hpp"

#include <gmock/gmock.h>

namespace stillmap::server {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::IsEmpty;

class PublisherTurnsOnATopic : public testing::Test {
 protected:
  /// A scan of each of these, 0.1 s after the one before.
  void send(const std::string& publishers) {
    for (const char publisher : publishers) turns_.add({publisher}, now_ += 100ms);
  }
  [[nodiscard]] std::vector<std::string> told() const { return turns_.publishers(now_); }

  PublisherTurns turns_;
  PublisherTurns::Clock::time_point now_ = PublisherTurns::Clock::time_point(1h);
};

TEST_F(PublisherTurnsOnATopic, AreToldWhereItGoesToAndFro) {
  send("aaaa");
  EXPECT_THAT(told(), IsEmpty());
  send("bababab");
  EXPECT_THAT(told(), ElementsAre("a", "b"));
  // One that is heard now and then counts, too.
  send("aaaaaaaaaaaaaaa");
  EXPECT_THAT(told(), ElementsAre("a", "b"));
}

TEST_F(PublisherTurnsOnATopic, AreNoneWhereOneFollowsAnother) {
  // The last scans of a driver that is started again may come late.
  send("aaaaabaabbbbbbccccdddddddeeee");
  EXPECT_THAT(told(), IsEmpty());
}

TEST_F(PublisherTurnsOnATopic, AreForgottenHalfAMinuteLater) {
  send("ababababab");
  EXPECT_THAT(told(), ElementsAre("a", "b"));
  now_ += 31s;
  EXPECT_THAT(told(), IsEmpty());
  send("aaaa");
  EXPECT_THAT(told(), IsEmpty());
}

}  // namespace
}  // namespace stillmap::server
