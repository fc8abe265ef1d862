#include <gtest/gtest.h>

#include "idl/conversions/removed_voxels.hpp"

namespace stillmap::wire {
namespace {

using stillmap_msgs::srv::GetRemoved_Response;

GetRemoved_Response response_of_two() {
  GetRemoved_Response response;
  write_removed({{{1.0F, -2.0F, 0.5F}, SemanticClass::car, RemovalReason::semi_static, 5},
                 {{3.0F, 4.0F, 1.5F}, SemanticClass::fence, RemovalReason::seen_through, -7}},
                response);
  return response;
}

TEST(RemovedOnTheWire, RoundTripLosesNothing) {
  const auto removed = from_response(response_of_two());
  ASSERT_TRUE(removed);
  ASSERT_EQ(removed->size(), 2U);
  EXPECT_EQ(removed->at(0).position_map, Eigen::Vector3f(1.0F, -2.0F, 0.5F));
  EXPECT_EQ(removed->at(0).label, SemanticClass::car);
  EXPECT_EQ(removed->at(0).reason, RemovalReason::semi_static);
  EXPECT_EQ(removed->at(1).reason, RemovalReason::seen_through);
  EXPECT_EQ(removed->at(1).last_seen_ns, -7);
}

TEST(RemovedOnTheWire, RefusesWhatMakesNoSense) {
  GetRemoved_Response short_list = response_of_two();
  short_list.z().pop_back();
  EXPECT_FALSE(from_response(short_list));
  GetRemoved_Response no_class = response_of_two();
  no_class.label()[1] = 20;
  EXPECT_FALSE(from_response(no_class));
  GetRemoved_Response no_reason = response_of_two();
  no_reason.reason()[0] = 4;
  EXPECT_FALSE(from_response(no_reason));
}

}  // namespace
}  // namespace stillmap::wire
