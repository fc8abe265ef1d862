#include "clients/gateway/connection_limit.hpp"

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <vector>

namespace stillmap::gateway {
namespace {

using Standing = ConnectionLimit::Standing;

/// Connections by number, as a server has them: each is taken in while there is room, and where
/// that makes too many, one is closed.
class Connections {
 public:
  explicit Connections(std::size_t max)
      : limit_(std::make_shared<ConnectionLimit>(max, [this] { ++freed_; })) {}

  /// False where it would have to wait.
  bool open(int number, Standing standing) {
    if (limit_->is_reached()) return false;
    auto lease = limit_->lend();
    lease->close_with([this, number] { leases_.erase(number); });
    leases_[number] = std::move(lease);
    if (limit_->is_reached()) limit_->close_one();
    if (leases_.contains(number)) leases_.at(number)->raise(standing);
    return true;
  }
  void end(int number) { leases_.erase(number); }

  [[nodiscard]] std::set<int> numbers() const {
    std::set<int> numbers;
    for (const auto& [number, lease] : leases_) numbers.insert(number);
    return numbers;
  }
  [[nodiscard]] int freed() const { return freed_; }

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
  EXPECT_EQ(connections.numbers(), (std::set{0, 1, 99}));
  ASSERT_TRUE(connections.open(2, Standing::session));
  EXPECT_EQ(connections.numbers(), (std::set{0, 1, 2}));
  ASSERT_TRUE(connections.open(3, Standing::session));
  EXPECT_EQ(connections.numbers(), (std::set{0, 2, 3}));
  EXPECT_EQ(connections.freed(), 0);
}

TEST(ConnectionLimit, SessionsTakeEveryPlaceAndAreNotClosedForOthers) {
  Connections connections(3);
  for (const int number : {0, 1, 2}) ASSERT_TRUE(connections.open(number, Standing::session));
  EXPECT_FALSE(connections.open(3, Standing::session));
  EXPECT_EQ(connections.numbers(), (std::set{0, 1, 2}));
  connections.end(1);
  EXPECT_EQ(connections.freed(), 1);
  EXPECT_TRUE(connections.open(3, Standing::session));
  EXPECT_EQ(connections.numbers(), (std::set{0, 2, 3}));
}

TEST(ConnectionLimit, WhatWasShownIsNotForgotten) {
  const auto limit = std::make_shared<ConnectionLimit>(3, [] {});
  std::set<int> closed;
  std::vector<std::shared_ptr<ConnectionLimit::Lease>> leases;
  for (const int number : {0, 1, 2}) {
    leases.push_back(limit->lend());
    leases.back()->close_with([&closed, number] { closed.insert(number); });
  }
  leases[0]->raise(Standing::session);
  leases[0]->raise(Standing::allowed);
  limit->close_one();
  EXPECT_EQ(closed, (std::set{1}));
  limit->close_one();
  EXPECT_EQ(closed, (std::set{1}));
}

TEST(ConnectionLimit, AConnectionThatIsClosedCountsNoMoreThoughItEndsLater) {
  int freed = 0;
  const auto limit = std::make_shared<ConnectionLimit>(2, [&] { ++freed; });
  int closed = 0;
  auto slow = limit->lend();
  slow->close_with([&] { ++closed; });
  const auto quick = limit->lend();
  EXPECT_TRUE(limit->is_reached());
  limit->close_one();
  limit->close_one();
  EXPECT_EQ(closed, 1);
  EXPECT_FALSE(limit->is_reached());
  slow = nullptr;
  EXPECT_EQ(freed, 0);
}

}  // namespace
}  // namespace stillmap::gateway
