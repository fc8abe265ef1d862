#include "core/segmentation/stream_labels.hpp"

#include <gtest/gtest.h>

namespace stillmap {
namespace {

Scan labelled_scan() {
  Scan scan;
  scan.points_lidar.assign(2, Eigen::Vector3f::Ones());
  scan.labels = {SemanticClass::road, SemanticClass::unlabeled};
  return scan;
}

TEST(StreamLabels, HandsOnTheScansLabelsAndTrustsThem) {
  const PointLabels labels = StreamLabels().label(labelled_scan());
  EXPECT_EQ(labels.classes, labelled_scan().labels);
  EXPECT_EQ(labels.confidence, (std::vector<float>{1.0F, 0.0F}));
}

TEST(StreamLabels, HasNoneForAScanWithoutLabels) {
  Scan scan = labelled_scan();
  scan.labels.clear();
  EXPECT_TRUE(StreamLabels().label(scan).empty());
}

TEST(NoLabels, IgnoresLabelsThatAreThere) {
  EXPECT_TRUE(NoLabels().label(labelled_scan()).empty());
  EXPECT_EQ(NoLabels().name(), "none");
}

}  // namespace
}  // namespace stillmap
