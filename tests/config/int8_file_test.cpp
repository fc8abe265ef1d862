#include "config/loaders/int8_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/config/config_files.hpp"

namespace stillmap {
namespace {

using test::refusal;
using test::write_file;
using ::testing::HasSubstr;

TEST(Int8File, ReadsBackWhatWasWritten) {
  const Int8Calibration written{
      .made = "32 scans of \"my city\": all",
      // Names as exporters make them, and one that YAML would take for something else.
      .range_of_channels = {{"/enc1/conv/Conv_output_0", {3.25F, 0.125F}},
                            {"onnx::Add_123", {1e-7F}},
                            {"477", {12345.0F}},
                            {"null", {0.0F}}},
      .float_layers = {"/head/Conv", "~"},
      // A number for YAML.
      .network_crc32 = "00123e45"};
  const auto file = test::test_folder() / "int8.yaml";
  save_int8_calibration(written, file);
  const std::optional<Int8Calibration> read = load_int8_calibration(file);
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(read->made, written.made);
  EXPECT_EQ(read->range_of_channels, written.range_of_channels);
  EXPECT_EQ(read->float_layers, written.float_layers);
  EXPECT_EQ(read->network_crc32, written.network_crc32);
}

TEST(Int8File, NeedNotBeThere) {
  EXPECT_FALSE(load_int8_calibration(test::test_folder() / "none.yaml").has_value());
}

TEST(Int8File, NamesWhatIsMissingOrWrong) {
  const auto refused = [](const std::string& yaml) {
    return refusal([&] { (void)load_int8_calibration(write_file("int8.yaml", yaml)); });
  };
  EXPECT_THAT(refused("made: x\n"), HasSubstr("ranges: is missing"));
  EXPECT_THAT(refused("ranges: {a: [-1]}\n"), HasSubstr("ranges.a"));
  EXPECT_THAT(refused("ranges: {a: [.nan]}\n"), HasSubstr("ranges.a"));
  EXPECT_THAT(refused("ranges: {a: wide}\n"), HasSubstr("ranges.a"));
  EXPECT_THAT(refused("ranges: {a: [1]}\nscale: 3\n"), HasSubstr("scale"));
}

TEST(Int8File, SaysWhenItCannotBeWritten) {
  const auto file = test::test_folder() / "no_such_folder" / "int8.yaml";
  EXPECT_THAT(refusal([&] { save_int8_calibration({}, file); }), HasSubstr("cannot be written"));
}

}  // namespace
}  // namespace stillmap
