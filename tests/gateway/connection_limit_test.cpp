#include "clients/gateway/connection_limit.hpp"

#include <gtest/gtest.h>

#include <map>
#include <set>

namespace stillmap::gateway {
namespace {

using Standing = ConnectionLimit::Standing;

/// Connections by number, which end at once where they are closed.
class Connections {
 public:
  explicit Connections(std::size_t max)
      : limit_(std::make_shared<ConnectionLimit>(max, [this] { ++freed_; })) {}

  /// Makes room first where there is none; false where that is not to be had.
  bool open(int number, Standing standing) {
    if (limit_->is_reached()) limit_->close_one();
    if (limit_->is_reached()) return false;
    auto lease = limit_->lend();
    lease->raise(standing);
    lease->close_with([this, number] { leases_.erase(number); });
    leases_[number] = std::move(lease);
    return true;
  }

  [[nodiscard]] std::set<int> numbers() const {
    std::set<int> numbers;
    for (const auto& [number, lease] : leases_) numbers.insert(number);
    return numbers;
  }
  [[nodiscard]] int freed() const { return freed_; }
  [[nodiscard]] ConnectionLimit& limit() { return *limit_; }
  ConnectionLimit::Lease& lease(int number) { return *leases_.at(number); }

 private:
  int freed_ = 0;
  std::shared_ptr<ConnectionLimit> limit_;
  std::map<int, std::shared_ptr<ConnectionLimit::Lease>> leases_;
};

TEST(ConnectionLimit, AFloodOfStrangersKeepsNobodyOutAndEndsNoSession) {
  Connections connections(4);
  ASSERT_TRUE(connections.open(0, Standing::session));
  ASSERT_TRUE(connections.open(1, Standing::allowed));
  for (int stranger = 10; stranger < 100; ++stranger) {
    ASSERT_TRUE(connections.open(stranger, Standing::unknown)) << stranger;
  }
  EXPECT_EQ(connections.numbers(), (std::set{0, 1, 98, 99}));
  EXPECT_TRUE(connections.open(2, Standing::allowed));
  EXPECT_TRUE(connections.open(3, Standing::session));
  EXPECT_EQ(connections.numbers(), (std::set{0, 1, 2, 3}));
  EXPECT_EQ(connections.freed(), 90);
}

TEST(ConnectionLimit, TheOldestOfThoseThatShowedLeastGoes) {
  Connections connections(3);
  for (const int number : {0, 1, 2}) ASSERT_TRUE(connections.open(number, Standing::unknown));
  connections.lease(0).raise(Standing::allowed);
  connections.limit().close_one();
  EXPECT_EQ(connections.numbers(), (std::set{0, 2}));
  // What was shown is not forgotten.
  connections.lease(2).raise(Standing::session);
  connections.lease(2).raise(Standing::allowed);
  connections.limit().close_one();
  EXPECT_EQ(connections.numbers(), (std::set{2}));
}

TEST(ConnectionLimit, SessionsAreNotClosedForOthers) {
  Connections connections(2);
  ASSERT_TRUE(connections.open(0, Standing::session));
  ASSERT_TRUE(connections.open(1, Standing::session));
  EXPECT_FALSE(connections.open(2, Standing::session));
  EXPECT_EQ(connections.numbers(), (std::set{0, 1}));
}

TEST(ConnectionLimit, AConnectionThatIsBeingClosedIsNotClosedAgain) {
  const auto limit = std::make_shared<ConnectionLimit>(2, [] {});
  int closed = 0;
  const auto slow = limit->lend();
  slow->close_with([&] { ++closed; });
  limit->close_one();
  limit->close_one();
  EXPECT_EQ(closed, 1);
  const auto quick = limit->lend();
  bool is_closed = false;
  quick->close_with([&] { is_closed = true; });
  limit->close_one();
  EXPECT_TRUE(is_closed);
}

}  // namespace
}  // namespace stillmap::gateway
