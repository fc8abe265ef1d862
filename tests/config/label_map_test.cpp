#include "config/loaders/label_map.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/config/config_files.hpp"

namespace stillmap {
namespace {

using test::refusal;
using test::shipped;
using test::write_file;
using ::testing::AllOf;
using ::testing::HasSubstr;

Motion motion_in_core(std::uint16_t raw_label) {
  if (is_moving_semantic_kitti(raw_label)) return Motion::highly_dynamic;
  const bool movable = is_movable(class_from_semantic_kitti(raw_label));
  return movable ? Motion::semi_static : Motion::stationary;
}

TEST(LabelMap, ShippedSemanticKittiFileEqualsTheTableInCore) {
  const LabelMap map = load_label_map(shipped("labels/semantic_kitti.yaml"));
  EXPECT_EQ(map.entries.size(), 34U);
  for (std::uint32_t raw = 0; raw <= 0xFFFF; ++raw) {
    const auto label = static_cast<std::uint16_t>(raw);
    ASSERT_EQ(map.class_of(label), class_from_semantic_kitti(label)) << label;
  }
  for (const auto& [raw, entry] : map.entries) {
    EXPECT_EQ(entry.motion, motion_in_core(raw)) << raw;
  }
}

TEST(LabelMap, RefusesWhatIsNoLabelMotionOrClass) {
  const auto file = write_file("a.yaml", R"(
name: mine
labels:
  -1: {class: car}
  70000: {class: car}
  1: {class: cars}
  2: {class: car, motion: fast}
  3: {motion: stationary}
  4: {class: car}
  04: {class: road}
)");
  EXPECT_THAT(refusal([&] { (void)load_label_map(file); }),
              AllOf(HasSubstr("labels.-1"), HasSubstr("labels.70000"),
                    HasSubstr("did you mean 'car'"), HasSubstr("labels.2.motion: 'fast'"),
                    HasSubstr("labels.3.class: is missing"), HasSubstr("mapped twice")));
}

TEST(LabelMap, RefusesAMapOfNothing) {
  EXPECT_THAT(refusal([] { (void)load_label_map(write_file("a.yaml", "name: x\n")); }),
              HasSubstr("maps no label"));
}

}  // namespace
}  // namespace stillmap
