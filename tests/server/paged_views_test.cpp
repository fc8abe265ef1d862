#include "server/services/paged_views.hpp"

#include <gtest/gtest.h>

namespace stillmap {
namespace {

using namespace std::chrono_literals;

PagedViews::View view_of(std::uint64_t version) {
  MapView view;
  view.version = version;
  return std::make_shared<const MapView>(std::move(view));
}

const PagedViews::Clock::time_point begin{};

TEST(PagedViews, LastUntilTheLastPage) {
  PagedViews views;
  PagedViews::View view = view_of(7);
  const std::weak_ptr<const MapView> watched = view;
  views.begin(view, begin);
  views.go_on(view, begin);
  EXPECT_EQ(views.find(7), view);
  EXPECT_EQ(views.find(8), nullptr);
  views.end(view);
  view.reset();
  EXPECT_TRUE(watched.expired());
}

TEST(PagedViews, LastUntilTheLastPageOfTheLastClient) {
  PagedViews views;
  const auto view = view_of(7);
  views.begin(view, begin);
  views.begin(view, begin);
  views.end(view);
  EXPECT_EQ(views.find(7), view);
  views.end(view);
  EXPECT_EQ(views.size(), 0U);
}

TEST(PagedViews, GoWhenTheirClientAsksNoMore) {
  PagedViews views;
  const auto slow = view_of(1);
  const auto gone = view_of(2);
  views.begin(slow, begin);
  views.begin(gone, begin);
  views.go_on(slow, begin + PagedViews::longest_pause);
  views.forget_abandoned(begin + PagedViews::longest_pause + 1s);
  EXPECT_EQ(views.find(1), slow);
  EXPECT_EQ(views.find(2), nullptr);
}

TEST(PagedViews, AreLimitedInNumber) {
  PagedViews views;
  const auto first = view_of(0);
  views.begin(first, begin);
  for (std::uint64_t version = 1; version <= PagedViews::most_views; ++version) {
    if (version == 5) views.go_on(first, begin);
    views.begin(view_of(version), begin);
  }
  EXPECT_EQ(views.size(), PagedViews::most_views);
  EXPECT_EQ(views.find(0), first);
  EXPECT_EQ(views.find(1), nullptr) << "the one that was asked for longest ago";
}

TEST(PagedViews, DoNotMindAnAnswerThatWasGivenUp) {
  PagedViews views;
  const auto view = view_of(3);
  views.end(view);
  EXPECT_EQ(views.size(), 0U);
  views.go_on(view, begin);
  EXPECT_EQ(views.find(3), view);
}

}  // namespace
}  // namespace stillmap
