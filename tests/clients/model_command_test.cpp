#include "tests/clients/command_test.hpp"
#include "tests/segmentation/onnx_builder.hpp"

namespace stillmap::test {
namespace {

constexpr std::uintmax_t pixels = 16 * 64;

/// With a model folder of a small network with random weights, for images of a VLP-16.
class ModelCommandTest : public CommandTest {
 protected:
  void SetUp() override {
    CommandTest::SetUp();
    std::filesystem::create_directories(folder_ / "model");
    std::ofstream(folder_ / "model/model.onnx", std::ios::binary) << light_bytes(8, 0, 0, 20);
    write("model/model.yaml", with_image("columns: 64"));
  }
  /// model.yaml; `width` is what it says of the columns.
  [[nodiscard]] static std::string with_image(const std::string& width) {
    std::string classes = "0: unlabeled";
    for (int i = 1; i < 20; ++i) classes += ", " + std::to_string(i) + ": car";
    return "name: tiny\nlicence: MIT\nimage: {rows: 16, " + width +
           ", fov_up_deg: 16, fov_down_deg: -16, follow_sensor: true}\n"
           "statistics:\n"
           "  range: {mean: 12, deviation: 12}\n  x: {mean: 10, deviation: 11}\n"
           "  y: {mean: 0, deviation: 7}\n  z: {mean: -1, deviation: 1}\n"
           "  remission: {mean: 0.2, deviation: 0.2}\n"
           "classes: {" +
           classes + "}\n";
  }
  [[nodiscard]] ProcessResult model(const std::string& arguments) const {
    return run("model " + arguments);
  }
  void calibrate() const {
    simulate("city", 3);
    const ProcessResult result = model("calibrate " + path("model") + " " + path("city"));
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }
};

TEST_F(ModelCommandTest, InfoSaysWhatItIsAndWhatRunsIt) {
  const ProcessResult result = model("info " + path("model") + " --steps");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, AllOf(HasSubstr("tiny"), HasSubstr("16x64"), HasSubstr("not calibrated"),
                                HasSubstr("channels  range, x, y, z, remission\n"),
                                HasSubstr("oneDNN fp32"), HasSubstr("convolve 5 to 8")));
}

TEST_F(ModelCommandTest, InfoTakesANetworkFileWithoutADescription) {
  const ProcessResult result = model("info " + path("model/model.onnx") + " --rows 32");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, AllOf(HasSubstr("32x1024"), HasSubstr("outputs   20")));
}

TEST_F(ModelCommandTest, CalibrationMakesInt8TheDefault) {
  calibrate();
  EXPECT_TRUE(exists("model/int8.yaml"));
  EXPECT_THAT(model("info " + path("model")).out,
              AllOf(HasSubstr("calibrated: 3 scans of 1 data sets"), HasSubstr("oneDNN int8")));
  write("image.f32", std::string(5 * pixels * sizeof(float), '\0'));
  const std::string files = " --input " + path("image.f32") + " --output " + path("out.f32");
  EXPECT_THAT(model("run " + path("model") + files).err, HasSubstr("oneDNN int8"));
  EXPECT_THAT(model("run " + path("model") + files + " --precision fp32").err,
              HasSubstr("oneDNN fp32"));
}

TEST_F(ModelCommandTest, CalibrationOfAnotherTrainingIsRefused) {
  calibrate();
  // The name of its producer: the file stays sound.
  std::ofstream(folder_ / "model/model.onnx", std::ios::binary | std::ios::app) << "\x12\x01x";
  const ProcessResult refused = model("info " + path("model"));
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("model/int8.yaml"), HasSubstr("network_crc32"),
                                 HasSubstr("stillmap model calibrate")));
  ASSERT_EQ(model("calibrate " + path("model") + " " + path("city")).exit_code, 0);
  EXPECT_EQ(model("info " + path("model")).exit_code, 0);
}

TEST_F(ModelCommandTest, CalibrationThatNoStartWouldTakeIsNotWritten) {
  OnnxBuilder network(5, 0, 0);
  const std::vector<float> zeros(8 * 5, 0.0F);
  network.weights(float_tensor("dead", {8, 5, 1, 1}, zeros), "dead");
  std::string x = network.node("Conv", {"input", "dead"}, 8);
  x = network.convolve(network.convolve(x, 8, {}, true), 20, {}, true);
  std::ofstream(folder_ / "model/model.onnx", std::ios::binary)
      << network.bytes(network.softmax(x));
  simulate("city", 3);
  const ProcessResult refused = model("calibrate " + path("model") + " " + path("city"));
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("int8.yaml"), HasSubstr("8 zeros"), HasSubstr("--scans"),
                                 HasSubstr("precision: fp32")));
  EXPECT_FALSE(exists("model/int8.yaml"));
}

TEST_F(ModelCommandTest, RunGivesProbabilitiesOfEveryImage) {
  write("images.f32", std::string(2 * 5 * pixels * sizeof(float), '\0'));
  const ProcessResult result = model("run " + path("model") + " --engine opencv --input " +
                                     path("images.f32") + " --output " + path("out.f32"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("2 images on OpenCV"));
  EXPECT_EQ(std::filesystem::file_size(folder_ / "out.f32"), 2 * 20 * pixels * sizeof(float));
}

TEST_F(ModelCommandTest, RunRefusesHalfAnImage) {
  write("image.f32", std::string(5 * pixels * sizeof(float) - 4, '\0'));
  const ProcessResult result = model("run " + path("model") + " --input " + path("image.f32") +
                                     " --output " + path("out.f32"));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, AllOf(HasSubstr("image.f32"), HasSubstr("5 channels (range, x, y, z, "
                                                                  "remission) x")));
}

TEST_F(ModelCommandTest, AgreeComparesTheEnginesOnARecording) {
  calibrate();
  const ProcessResult result = model("agree " + path("model") + " " + path("city") + " --scans 2");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, AllOf(HasSubstr("oneDNN fp32"), HasSubstr("oneDNN int8"),
                                HasSubstr("100.000"), HasSubstr("class of 2048 pixels")));
}

TEST_F(ModelCommandTest, SpeedPrintsARowForEachEngineAndSize) {
  const ProcessResult result =
      model("speed " + path("model") + " --columns 64,128 --skip-opencv --threads 1");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, AllOf(HasSubstr("16x64"), HasSubstr("16x128"), HasSubstr("oneDNN fp32"),
                                HasSubstr("oneDNN int8")));
}

TEST_F(ModelCommandTest, MapsWithTheModelThatIsNamed) {
  simulate("city", 3);
  const ProcessResult result = run("map " + path("city") + " --labels " + path("model") +
                                   " --engine onednn --out " + path("out") + " --json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(nlohmann::json::parse(result.out).at("label_source"), "tiny");
}

TEST_F(ModelCommandTest, TellsOfItsNarrowestImageAndTakesNoneThatIsWider) {
  const auto with_least = [&](const std::string& least) {
    write("model/model.yaml", with_image("columns: 64, min_columns: " + least));
    return model("info " + path("model"));
  };
  EXPECT_THAT(with_least("32").out, HasSubstr("16x64, down to 32 columns"));
  const ProcessResult wider = with_least("128");
  EXPECT_EQ(wider.exit_code, 2);
  EXPECT_THAT(wider.err, AllOf(HasSubstr("min_columns"), HasSubstr("128")));
}

TEST_F(ModelCommandTest, ANetworkOfOneSizeTakesNoOtherWidth) {
  simulate("city", 1);
  std::ofstream(folder_ / "model/model.onnx", std::ios::binary) << light_bytes(8, 16, 64, 20);
  const std::string map = "map " + path("city") + " --labels " + path("model") + " --out " +
                          path("out") + " --columns ";
  const ProcessResult other = run(map + "128");
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, AllOf(HasSubstr("with 128 image columns"), HasSubstr("model.onnx")));
  EXPECT_EQ(run(map + "64").exit_code, 0);
  const std::string speed = "speed " + path("model") + " --skip-opencv --threads 1 --columns ";
  const ProcessResult nothing = model(speed + "128");
  EXPECT_EQ(nothing.exit_code, 2) << "nothing was measured";
  EXPECT_THAT(nothing.err, HasSubstr("skipped"));
  EXPECT_EQ(model(speed + "128,64").exit_code, 0);
}

TEST_F(ModelCommandTest, BadModelsAreBadInput) {
  EXPECT_EQ(model("info " + path("nothing")).exit_code, 2);
  EXPECT_EQ(model("speed " + path("model") + " --columns wide").exit_code, 2);
  const ProcessResult late = model("speed " + path("model") + " --columns 64,wide --skip-opencv");
  EXPECT_EQ(late.exit_code, 2);
  EXPECT_THAT(late.err, testing::Not(HasSubstr("timing"))) << "before minutes of measuring";
  write("model/model.onnx", "no network");
  const ProcessResult result = model("info " + path("model"));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("model.onnx"));
}

}  // namespace
}  // namespace stillmap::test
