#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "tests/fuzz/fuzz_target.hpp"
#include "tests/fuzz/memory_folder.hpp"

namespace stillmap::fuzz {
namespace {

namespace fs = std::filesystem;

void run(const Target& target, const std::string& bytes) {
  target.run({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
}

/// Runs the target on every file of a folder that may not be there; returns how many.
std::size_t run_files(const Target& target, const fs::path& folder) {
  if (!fs::exists(folder)) return 0;
  std::size_t files = 0;
  for (const auto& entry : fs::directory_iterator(folder)) {
    SCOPED_TRACE(entry.path().string());
    EXPECT_NO_THROW(run(target, content_of(entry.path())));
    ++files;
  }
  return files;
}

/// What ever went wrong, and inputs that once led to a new place in the code.
class FuzzRegression : public testing::TestWithParam<const Target*> {
 protected:
  const Target& target_ = *GetParam();
};

TEST_P(FuzzRegression, SeedsAreTaken) {
  const auto seeds = target_.seeds();
  EXPECT_FALSE(seeds.empty());
  for (const Seed& seed : seeds) {
    SCOPED_TRACE(seed.name);
    EXPECT_NO_THROW(run(target_, seed.bytes));
  }
}

TEST_P(FuzzRegression, CutOffSeedsAreTaken) {
  for (const Seed& seed : target_.seeds()) {
    SCOPED_TRACE(seed.name);
    for (const double share : {0.0, 0.1, 0.5, 0.9, 0.99}) {
      const auto length = static_cast<std::size_t>(static_cast<double>(seed.bytes.size()) * share);
      EXPECT_NO_THROW(run(target_, seed.bytes.substr(0, length)));
    }
  }
}

TEST_P(FuzzRegression, KeptInputsAreTaken) {
  const fs::path folder(STILLMAP_FUZZ_FOLDER);
  const std::size_t files = run_files(target_, folder / "corpus" / target_.name) +
                            run_files(target_, folder / "crashes" / target_.name);
  EXPECT_GT(files, 0U) << "tests/fuzz/corpus/" << target_.name << " is empty";
}

INSTANTIATE_TEST_SUITE_P(Targets, FuzzRegression,
                         testing::Values(&point_cloud_target, &service_request_target,
                                         &continuation_target, &message_target, &octomap_target,
                                         &tile_target, &map_file_target, &map_rows_target,
                                         &cloud_file_target, &pose_file_target, &bag_message_target,
                                         &bag_file_target, &mcap_file_target, &onnx_target,
                                         &model_folder_target, &config_file_target),
                         [](const auto& param_info) {
                           return std::string(param_info.param->name);
                         });

}  // namespace
}  // namespace stillmap::fuzz
