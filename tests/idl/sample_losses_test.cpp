#include "idl/dds/sample_losses.hpp"

#include <gtest/gtest.h>

#include "idl/dds/reader.hpp"
#include "idl/dds/writer.hpp"
#include "tests/idl/dds_fixture.hpp"

namespace stillmap::dds {
namespace {

using namespace std::chrono_literals;
using eprosima::fastrtps::rtps::SampleIdentity;
using sensor_msgs::msg::PointCloud2;

SampleIdentity sample(std::uint8_t writer, std::uint32_t number) {
  SampleIdentity identity;
  identity.writer_guid().guidPrefix.value[0] = writer;
  identity.sequence_number() = {0, number};
  return identity;
}

TEST(SampleLosses, AreTheGapsOfEachWriter) {
  SampleLosses losses;
  // A late joiner has missed nothing.
  EXPECT_EQ(losses.add(sample(1, 100)), 0U);
  EXPECT_EQ(losses.add(sample(2, 7)), 0U);
  EXPECT_EQ(losses.add(sample(1, 101)), 0U);
  EXPECT_EQ(losses.add(sample(1, 105)), 3U);
  EXPECT_EQ(losses.add(sample(2, 9)), 1U);
  // Again, as a second reader gets it.
  EXPECT_EQ(losses.add(sample(2, 8)), 0U);
  EXPECT_EQ(losses.lost(), 4U);
}

TEST(SampleLosses, RemembersABoundedNumberOfWriters) {
  SampleLosses losses;
  losses.add(sample(0, 1));
  for (std::uint32_t i = 0; i < 1000; ++i) {
    SampleIdentity other = sample(1, 1);
    std::memcpy(&other.writer_guid().guidPrefix.value[4], &i, sizeof i);
    losses.add(other);
    // The one that goes on is not forgotten.
    EXPECT_EQ(losses.add(sample(0, 2 * i + 3)), 1U);
  }
  EXPECT_EQ(losses.lost(), 1000U);
}

class BestAvailable : public testing::Test {
 protected:
  /// Takes so many samples and what comes soon after; returns their numbers, sorted.
  std::vector<std::uint32_t> take_all(std::size_t wanted) {
    std::vector<std::uint32_t> numbers;
    PointCloud2 cloud;
    while (reader_.take(cloud, {}, numbers.size() < wanted ? discovery_timeout : 500ms)) {
      numbers.push_back(cloud.width());
    }
    std::ranges::sort(numbers);
    return numbers;
  }

  Participant here_{loopback(false)};
  Participant there_{loopback(false)};
  Reader<PointCloud2> reader_{here_, "rt/points", {.accept_best_effort = true}};
};

TEST_F(BestAvailable, ReadsEachSampleOnceFromWritersOfBothKinds) {
  Writer<PointCloud2> reliable(there_, "rt/points", {});
  ASSERT_TRUE(reliable.readers().wait_for_any(discovery_timeout));
  Writer<PointCloud2> best_effort(there_, "rt/points", {.reliable = false});
  // Only who takes opens the second reader.
  const auto both_match = [&] {
    EXPECT_TRUE(take_all(0).empty());
    return best_effort.readers().count() > 0 && reader_.matched_writers() == 2;
  };
  ASSERT_TRUE(test::eventually(both_match, discovery_timeout));
  EXPECT_EQ(reader_.incompatible_writers(), 0);
  for (std::uint32_t i = 1; i <= 3; ++i) {
    ASSERT_TRUE(reliable.write(cloud_of(1000, i)));
    ASSERT_TRUE(best_effort.write(cloud_of(1000, 100 + i)));
  }
  EXPECT_EQ(take_all(6), (std::vector<std::uint32_t>{1, 2, 3, 101, 102, 103}));
}

}  // namespace
}  // namespace stillmap::dds
