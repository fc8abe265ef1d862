#include "idl/dds/type_support.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <string>

#include "sensor_msgs.h"
#include "tests/idl/cloud_fixture.hpp"

namespace stillmap::dds {
namespace {

using eprosima::fastdds::dds::TypeSupport;
using eprosima::fastrtps::rtps::SerializedPayload_t;
using sensor_msgs::msg::PointCloud2;

/// What a peer sends: the bytes of a sample.
class TypeSupportTest : public testing::Test {
 protected:
  TypeSupportTest() {
    PointCloud2 cloud = wire::three_points();
    SerializedPayload_t payload(type_->getSerializedSizeProvider(&cloud)());
    EXPECT_TRUE(type_->serialize(&cloud, &payload));
    sample_.assign(reinterpret_cast<const char*>(payload.data), payload.length);
  }

  [[nodiscard]] bool is_read() {
    SerializedPayload_t payload(static_cast<std::uint32_t>(sample_.size()));
    std::memcpy(payload.data, sample_.data(), sample_.size());
    payload.length = static_cast<std::uint32_t>(sample_.size());
    PointCloud2 cloud;
    return type_->deserialize(&payload, &cloud);
  }

  TypeSupport type_ = type_support<PointCloud2>();
  std::string sample_;
};

TEST_F(TypeSupportTest, HasTheNameThatRosGivesTheType) {
  EXPECT_EQ(type_.get_type_name(), "sensor_msgs::msg::dds_::PointCloud2_");
}

TEST_F(TypeSupportTest, ReadsASample) { EXPECT_TRUE(is_read()); }

TEST_F(TypeSupportTest, RefusesAnUnknownEncapsulation) {
  sample_[1] = '\x77';
  EXPECT_FALSE(is_read());
}

TEST_F(TypeSupportTest, RefusesABooleanThatIsNeither) {
  sample_.back() = '\x02';  // is_dense, the last member
  EXPECT_FALSE(is_read());
}

TEST_F(TypeSupportTest, RefusesASampleThatEndsEarly) {
  sample_.resize(sample_.size() / 2);
  EXPECT_FALSE(is_read());
}

}  // namespace
}  // namespace stillmap::dds
