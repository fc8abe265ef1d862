#include "server/services/paged_snapshots.hpp"

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

TEST(PagedViews, LastUntilSoonAfterTheLastPage) {
  PagedViews views;
  PagedViews::View view = view_of(7);
  const std::weak_ptr<const MapView> watched = view;
  views.keep(view, begin);
  EXPECT_EQ(views.find(7), view);
  EXPECT_EQ(views.find(8), nullptr);
  views.end(view, begin);
  views.forget_abandoned(begin + PagedViews::last_page_repeats);
  EXPECT_EQ(views.find(7), view) << "the last page may be asked for again";
  views.forget_abandoned(begin + PagedViews::last_page_repeats + 1s);
  view.reset();
  EXPECT_TRUE(watched.expired());
}

TEST(PagedViews, LastWhileAnotherClientGoesOnPaging) {
  PagedViews views;
  const auto view = view_of(7);
  views.keep(view, begin);
  views.end(view, begin);
  views.keep(view, begin + 1s);
  views.forget_abandoned(begin + PagedViews::longest_pause);
  EXPECT_EQ(views.find(7), view);
  EXPECT_EQ(views.size(), 1U);
}

TEST(PagedViews, GoWhenTheirClientAsksNoMore) {
  PagedViews views;
  const auto slow = view_of(1);
  const auto gone = view_of(2);
  views.keep(slow, begin);
  views.keep(gone, begin);
  views.keep(slow, begin + PagedViews::longest_pause);
  views.forget_abandoned(begin + PagedViews::longest_pause + 1s);
  EXPECT_EQ(views.find(1), slow);
  EXPECT_EQ(views.find(2), nullptr);
}

TEST(PagedViews, AreLimitedInNumber) {
  PagedViews views;
  const auto first = view_of(0);
  views.keep(first, begin);
  for (std::uint64_t version = 1; version <= PagedViews::most_views; ++version) {
    if (version == 5) views.keep(first, begin);
    views.keep(view_of(version), begin);
  }
  EXPECT_EQ(views.size(), PagedViews::most_views);
  EXPECT_EQ(views.find(0), first);
  EXPECT_EQ(views.find(1), nullptr) << "the one that was asked for longest ago";
}

TEST(PagedViews, DoNotMindTheEndOfWhatIsGone) {
  PagedViews views;
  views.end(view_of(3), begin);
  EXPECT_EQ(views.size(), 0U);
}

}  // namespace
}  // namespace stillmap
