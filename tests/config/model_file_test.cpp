#include "config/loaders/model_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "config/loaders/model_folder.hpp"
#include "core/segmentation/model_error.hpp"
#include "tests/config/config_files.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

using test::refusal;
using test::write_file;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

const std::string sound = R"(
name: tiny
licence: MIT
sensor: HDL-64E
training: by hand
accuracy: unknown
image: {rows: 64, columns: 512, fov_up_deg: 3, fov_down_deg: -25}
statistics:
  range: {mean: 12.12, deviation: 12.32}
  x: {mean: 10.88, deviation: 11.47}
  y: {mean: 0.23, deviation: 6.91}
  z: {mean: -1.04, deviation: 0.86}
  remission: {mean: 0.21, deviation: 0.16}
classes: {0: unlabeled, 1: car, 2: road}
knn: {neighbours: 7}
)";

ModelDescription load_model(const std::string& yaml) {
  return load_model_description(write_file("model.yaml", yaml).parent_path());
}

std::string changed(std::string yaml, const std::string& from, const std::string& to) {
  EXPECT_NE(yaml.find(from), std::string::npos);
  return yaml.replace(yaml.find(from), from.size(), to);
}

std::string refusal_of(const std::string& yaml, const std::string& from, const std::string& to) {
  return refusal([&] { (void)load_model(changed(yaml, from, to)); });
}

TEST(ModelFile, ReadsADescriptionThatCanBeUsed) {
  const ModelDescription model = load_model(sound);
  EXPECT_EQ(model.faults(), "");
  EXPECT_EQ(model.name, "tiny");
  EXPECT_EQ(model.columns, 512);
  EXPECT_NEAR(model.fov_down, -25.0 * std::numbers::pi / 180.0, 1e-12);
  EXPECT_FLOAT_EQ(model.statistics.mean[3], -1.04F);
  EXPECT_FLOAT_EQ(model.statistics.deviation[4], 0.16F);
  EXPECT_EQ(model.classes,
            (std::vector{SemanticClass::unlabeled, SemanticClass::car, SemanticClass::road}));
  EXPECT_EQ(model.knn->neighbours, 7);
  EXPECT_FALSE(model.voxel_votes.has_value());
  EXPECT_EQ(model.network_file, test::test_folder() / "model.onnx");
}

TEST(ModelFile, ReadsVotesInVoxels) {
  const std::string yaml =
      sound + "voxel_votes: {edge_m: 0.4, height_m: 0.3, neighbour_weight: 0.25}\n";
  const ModelDescription model = load_model(yaml);
  ASSERT_TRUE(model.voxel_votes.has_value());
  EXPECT_EQ(model.voxel_votes->edge_m, 0.4);
  EXPECT_EQ(model.voxel_votes->height_m, 0.3);
  EXPECT_EQ(model.voxel_votes->neighbour_weight, 0.25);
  EXPECT_EQ(model.voxel_votes->own_weight, 0.3);
  EXPECT_FALSE(load_model(sound + "voxel_votes: {use: false}\n").voxel_votes.has_value());
  EXPECT_THAT(refusal_of(yaml, "edge_m: 0.4", "edge_m: 0"), HasSubstr("voxel_votes.edge_m"));
  EXPECT_THAT(refusal_of(yaml, "0.25", "2"), HasSubstr("voxel_votes.neighbour_weight"));
}

TEST(ModelFile, ReadsVotesOfThoseWhoAreUnsure) {
  const std::string voxels = sound + "voxel_votes: {edge_m: 0.4}\n";
  const std::string yaml = voxels +
                           "unsure_votes: {edge_m: 0.6, height_m: 0.2, neighbour_weight: 0.25, "
                           "unsure_below: 0.3, unsure_small_below: 0.7, small_weight: 0.6}\n";
  const ModelDescription model = load_model(yaml);
  ASSERT_TRUE(model.unsure_votes.has_value());
  EXPECT_EQ(model.unsure_votes->edge_m, 0.6);
  EXPECT_EQ(model.unsure_votes->height_m, 0.2);
  EXPECT_EQ(model.unsure_votes->neighbour_weight, 0.25);
  EXPECT_EQ(model.unsure_votes->unsure_below, 0.3);
  EXPECT_EQ(model.unsure_votes->unsure_small_below, 0.7);
  EXPECT_EQ(model.unsure_votes->small_weight, 0.6);
  EXPECT_THAT(refusal_of(yaml, "edge_m: 0.6", "edge_m: 0"), HasSubstr("unsure_votes.edge_m"));
  EXPECT_THAT(refusal_of(yaml, "below: 0.3", "below: 3"), HasSubstr("unsure_votes.unsure_below"));
  EXPECT_THAT(refusal_of(yaml, "small_weight", "small"), HasSubstr("unsure_votes.small"));
}

TEST(ModelFile, HasVotesOfThoseWhoAreUnsureAfterThoseInVoxelsUnlessItSaysOtherwise) {
  const std::string voxels = sound + "voxel_votes: {edge_m: 0.4}\n";
  EXPECT_TRUE(load_model(voxels).unsure_votes.has_value());
  EXPECT_FALSE(load_model(voxels + "unsure_votes: {use: false}\n").unsure_votes.has_value());
  EXPECT_FALSE(load_model(sound).unsure_votes.has_value());
}

TEST(ModelFile, ReadsVotesAroundVehicles) {
  const std::string yaml = sound + "island_votes: {edge_m: 0.4, share: 1.5}\n";
  const ModelDescription model = load_model(yaml);
  ASSERT_TRUE(model.island_votes.has_value());
  EXPECT_EQ(model.island_votes->edge_m, 0.4);
  EXPECT_EQ(model.island_votes->share, 1.5);
  EXPECT_FALSE(load_model(sound).island_votes.has_value());
  EXPECT_THAT(refusal_of(yaml, "share: 1.5", "share: 0"), HasSubstr("island_votes.share"));
}

TEST(ModelFile, ReadsWhetherTheNetworkTakesTheSlope) {
  EXPECT_EQ(load_model(sound).statistics.channels, 5U);
  std::string yaml = sound;
  yaml.insert(yaml.find("classes:"), "  slope: {mean: 0.53, deviation: 0.86}\n");
  const ModelDescription model = load_model(yaml);
  EXPECT_EQ(model.statistics.channels, 6U);
  EXPECT_FLOAT_EQ(model.statistics.mean[5], 0.53F);
  EXPECT_FLOAT_EQ(model.statistics.deviation[5], 0.86F);
  EXPECT_THAT(refusal_of(yaml, "deviation: 0.86}\nclasses", "deviation: 0}\nclasses"),
              HasSubstr("statistics.slope.deviation"));
}

TEST(ModelFile, ReadsItsCalibrationAndWhetherItFollowsTheSensor) {
  // Of a run before.
  std::filesystem::remove(test::test_folder() / "int8.yaml");
  EXPECT_FALSE(load_model(sound).int8.has_value());
  EXPECT_FALSE(load_model(sound).follow_sensor);
  std::string yaml = sound;
  yaml.replace(yaml.find("fov_down_deg: -25}"), 18, "fov_down_deg: -25, follow_sensor: true}");
  (void)write_file("int8.yaml", "ranges: {a: [2, 3]}\n");
  const ModelDescription model = load_model(yaml);
  EXPECT_TRUE(model.follow_sensor);
  ASSERT_TRUE(model.int8.has_value());
  EXPECT_EQ(model.int8->range_of_channels.at("a"), (std::vector{2.0F, 3.0F}));
}

TEST(ModelFile, CalibrationsOfShippedModelsBelongToTheirNetworks) {
  ASSERT_FALSE(known_models().empty());
  for (const std::filesystem::path& folder : known_models()) {
    const ModelDescription model = load_model_description(folder);
    ASSERT_TRUE(model.int8.has_value()) << folder;
    EXPECT_EQ(model.int8->network_crc32, crc32_of(model.network_file)) << folder;
  }
}

TEST(ModelFile, ReadsWhatItWasTrainedFor) {
  EXPECT_FALSE(load_model(sound).trained_for.has_value());
  const std::string field =
      "trained_for: {min_beams: 16, max_beams: 64, fov_up_deg: 15, fov_down_deg: -31.4}\n";
  const ModelDescription model = load_model(sound + field);
  ASSERT_TRUE(model.trained_for.has_value());
  EXPECT_EQ(in_words(*model.trained_for), "16 to 64 beams from +15 to -31.4 degrees");
  EXPECT_THAT(refusal_of(sound + field, "max_beams: 64", "max_beams: 8"),
              HasSubstr("trained_for.max_beams"));
  EXPECT_THAT(refusal_of(sound + field, "fov_up_deg: 15", "fov_up_deg: -40"),
              HasSubstr("trained_for.fov_down_deg"));
}

TEST(ModelFile, ReadsTheHeightOfItsLidars) {
  EXPECT_FALSE(load_model(sound).lidar_height_m.has_value());
  const std::string field = "lidar_height_m: 1.5\n";
  EXPECT_EQ(load_model(sound + field).lidar_height_m, 1.5);
  EXPECT_THAT(refusal_of(sound + field, "_m: 1.5", "_m: 15"), HasSubstr("lidar_height_m"));
}

TEST(BetterModel, IsTheOneThatWasTrainedForSuchLidarsMostOfAll) {
  const auto better = [](const char* used, const SensorModel& sensor) {
    return better_model({.source = LabelProvider::model, .model = used, .engine = {}}, sensor);
  };
  EXPECT_THAT(better("street", hdl_64e()),
              AllOf(HasSubstr("'kitti'"), HasSubstr("not for commercial use")));
  EXPECT_EQ(better("street", vlp_16()), "");
  EXPECT_THAT(better("kitti", vlp_16()), HasSubstr("'street'"));
  EXPECT_EQ(better("kitti", hdl_64e()), "");
  EXPECT_EQ(
      better_model({.source = LabelProvider::stream, .model = "street", .engine = {}}, hdl_64e()),
      "");
  SensorModel irregular = vlp_16();
  irregular.pattern = ScanPattern::irregular;
  EXPECT_EQ(better("kitti", irregular), "");
}

TEST(ModelFile, CanSwitchTheVotesOff) {
  std::string yaml = sound;
  yaml.replace(yaml.find("{neighbours: 7}"), 15, "{use: false}");
  EXPECT_FALSE(load_model(yaml).knn.has_value());
}

TEST(ModelFile, RefusesHolesInTheClassMap) {
  EXPECT_THAT(refusal_of(sound, "1: car", "5: car"), HasSubstr("output 1 has no class"));
  EXPECT_THAT(refusal_of(sound, "1: car", "1: cat"), HasSubstr("did you mean 'car'"));
  EXPECT_THAT(refusal_of(sound, "classes: {0: unlabeled, 1: car, 2: road}", "classes: {}"),
              HasSubstr("classes"));
}

TEST(ModelFile, NamesWhatIsMissingOrWrong) {
  EXPECT_THAT(refusal_of(sound, "licence: MIT\n", ""), HasSubstr("licence: is missing"));
  EXPECT_THAT(refusal_of(sound, "  z: {mean: -1.04, deviation: 0.86}\n", ""),
              AllOf(HasSubstr("statistics.z: is missing")));
  EXPECT_THAT(refusal_of(sound, "deviation: 0.86", "deviation: 0"),
              HasSubstr("statistics.z.deviation"));
  EXPECT_THAT(refusal_of(sound, "rows: 64", "rows: -64"), HasSubstr("image.rows: '-64'"));
  EXPECT_THAT(refusal_of(sound, "fov_up_deg: 3", "fov_up_deg: -30"), HasSubstr("below"));
  EXPECT_THAT(refusal_of(sound, "neighbours: 7", "window: 4"), HasSubstr("odd"));
}

TEST(ModelFile, NameAndLicenceAreLinesThatCanBeShown) {
  for (const std::string field : {"name", "licence"}) {
    const std::string given = field + (field == "name" ? ": tiny" : ": MIT");
    const auto refusal_with = [&](const std::string& text) {
      return refusal_of(sound, given, field + ": " + text);
    };
    // Line ends, escapes and the 8-bit kind of them, text that runs backwards, and Latin-1.
    for (const char* const text :
         {R"("tiny\n2026 all is well")", R"("\e[31mred")", R"("\x9B31mred")", R"("a\Lb")",
          R"("tiny\N2026 all is well")", R"("a\u202Eb")", "mod\xE8le"})
      EXPECT_THAT(refusal_with(text), HasSubstr(field + ": must be one line")) << text;
    for (const char* const text : {R"("")", R"("  \n")", "", "~"})
      EXPECT_THAT(refusal_with(text), HasSubstr(field + ": must not be empty")) << text;
    EXPECT_THAT(refusal_with("[a]"), AllOf(HasSubstr(field), Not(HasSubstr("must"))));
  }
  EXPECT_EQ(load_model(changed(sound, "name: tiny", "name: >\n  a model of\n  ours\n")).name,
            "a model of ours");
  EXPECT_EQ(load_model(changed(sound, "name: tiny", "name: modèle 雪")).name, "modèle 雪");
}

TEST(ModelFile, RefusesAFolderThatIsNotThere) {
  EXPECT_THAT(refusal([] { (void)load_model_description(test::test_folder() / "none"); }),
              HasSubstr("is not a folder"));
}

TEST(Segmenter, IsTheOneAskedFor) {
  const auto name = [](LabelProvider source) {
    return open_segmenter({.source = source, .model = {}, .image_columns = 0, .engine = {}},
                          hdl_64e())
        ->name();
  };
  EXPECT_EQ(name(LabelProvider::stream), "stream");
  EXPECT_EQ(name(LabelProvider::none), "none");
}

TEST(Segmenter, NamesTheNetworkFileThatIsMissing) {
  const auto folder = write_file("model.yaml", sound).parent_path();
  try {
    (void)open_segmenter(
        {.source = LabelProvider::model, .model = folder, .image_columns = 0, .engine = {}},
        hdl_64e());
    FAIL() << "a model without a network was opened";
  } catch (const ModelError& error) {
    EXPECT_THAT(error.what(), HasSubstr("model.onnx"));
  }
}

TEST(ModelFolder, AFolderOfAnotherKindHidesNoModel) {
  const ScratchFolder folder;
  std::filesystem::create_directory(folder.path() / "street");
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder.path());
  const std::filesystem::path found = find_model("street");
  std::filesystem::current_path(before);
  EXPECT_TRUE(std::filesystem::exists(found / "model.yaml")) << found;
}

TEST(OpenSegmenter, GivesALidarThatLeansMoreRows) {
  const auto details = [](const Eigen::Isometry3d& T_base_lidar) {
    return open_segmenter({.source = LabelProvider::automatic, .engine = {}}, vlp_16(), false,
                          T_base_lidar)
        ->details();
  };
  EXPECT_THAT(details(Eigen::Isometry3d::Identity()), HasSubstr("image 32x1536"));
  EXPECT_THAT(details(Eigen::Isometry3d(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()))),
              HasSubstr("image 48x1536"));
}

}  // namespace
}  // namespace stillmap
