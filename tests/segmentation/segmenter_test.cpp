#include "core/segmentation/segmenter.hpp"

#include <gtest/gtest.h>

#include <memory>

namespace stillmap {
namespace {

Scan labelled_scan() {
  Scan scan;
  scan.points_lidar.assign(2, Eigen::Vector3f::Ones());
  scan.labels = {SemanticClass::road, SemanticClass::unlabeled};
  return scan;
}

TEST(PassthroughSegmenter, ReturnsTheScansLabelsWithConfidenceOne) {
  const PointLabels labels = PassthroughSegmenter().segment(labelled_scan());
  EXPECT_EQ(labels.classes, labelled_scan().labels);
  EXPECT_EQ(labels.confidence, (std::vector<float>{1.0F, 0.0F}));
}

TEST(PassthroughSegmenter, HasNoneForAScanWithoutLabels) {
  Scan scan = labelled_scan();
  scan.labels.clear();
  EXPECT_TRUE(PassthroughSegmenter().segment(scan).empty());
}

TEST(PassthroughSegmenter, HasNoneForAFieldThatNobodyFilled) {
  Scan scan = labelled_scan();
  scan.labels.assign(scan.size(), SemanticClass::unlabeled);
  EXPECT_TRUE(PassthroughSegmenter().segment(scan).empty());
}

TEST(NullSegmenter, IgnoresLabelsThatAreThere) {
  EXPECT_TRUE(NullSegmenter().segment(labelled_scan()).empty());
  EXPECT_EQ(NullSegmenter().name(), "none");
}

class AllCars final : public Segmenter {
 public:
  [[nodiscard]] std::string name() const override { return "all cars"; }
  [[nodiscard]] PointLabels segment(const Scan& scan) override {
    return {.classes = std::vector(scan.size(), SemanticClass::car),
            .confidence = std::vector(scan.size(), 0.5F)};
  }
  void set_mount(const Eigen::Isometry3d& T_base_lidar) override {
    height_m = T_base_lidar.translation().z();
  }

  double height_m = 0.0;
};

TEST(FallbackSegmenter, UsesTheFallbackOnlyForScansWithoutLabels) {
  FallbackSegmenter labels(std::make_unique<AllCars>());
  EXPECT_EQ(labels.name(), "stream, else all cars");
  EXPECT_EQ(labels.segment(labelled_scan()).classes, labelled_scan().labels);
  Scan scan = labelled_scan();
  scan.labels.clear();
  EXPECT_EQ(labels.segment(scan).classes[1], SemanticClass::car);
}

TEST(FallbackSegmenter, UsesTheFallbackWhereNoClassIsKnown) {
  FallbackSegmenter labels(std::make_unique<AllCars>());
  Scan scan = labelled_scan();
  EXPECT_TRUE(labels.has_labels(scan));
  scan.labels.assign(scan.size(), SemanticClass::unlabeled);
  EXPECT_FALSE(labels.has_labels(scan));
  EXPECT_EQ(labels.segment(scan).classes[0], SemanticClass::car);
}

TEST(FallbackSegmenter, TellsTheFallbackTheMount) {
  auto cars = std::make_unique<AllCars>();
  const AllCars& told = *cars;
  FallbackSegmenter labels(std::move(cars));
  labels.set_mount(Eigen::Isometry3d(Eigen::Translation3d(0.0, 0.0, 1.5)));
  EXPECT_EQ(told.height_m, 1.5);
}

}  // namespace
}  // namespace stillmap
