#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/clients/process.hpp"
#include "tests/eventually.hpp"

namespace stillmap::test {

/// An option that takes seconds, for as long as a loaded machine may need.
inline std::string patiently(const std::string& option = "--timeout") {
  return " " + option + " " + std::to_string(patience.count());
}

/// Runs the real program in a fresh folder.
class CommandTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ =
        std::filesystem::path(testing::TempDir()) / (std::string(info->test_suite_name()) + "_" +
                                                     info->name() + "_" + std::to_string(getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder_ / name).string();
  }
  [[nodiscard]] ProcessResult run(const std::string& arguments) const {
    return run_stillmap(arguments, folder_);
  }
  /// A small recording: one block, 16 beams.
  void simulate(const std::string& name, int scans = 6, const std::string& options = "") const {
    const ProcessResult result = run("simulate " + path(name) + " --preset yard --sensor vlp_16" +
                                     " --scans " + std::to_string(scans) + options);
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }
  /// Puts `text` where a file was or was not.
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::trunc) << text;
  }
  [[nodiscard]] bool exists(const std::string& name) const {
    return std::filesystem::exists(folder_ / name);
  }
  [[nodiscard]] std::string content(const std::string& name) const {
    std::ifstream stream(folder_ / name);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  /// Waits until a file contains the text.
  [[nodiscard]] bool comes_to_contain(const std::string& name, const std::string& text) const {
    return eventually([&] { return content(name).find(text) != std::string::npos; });
  }
  [[nodiscard]] std::size_t line_count(const std::string& name) const {
    const std::string text = content(name);
    return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
  }

  std::filesystem::path folder_;
};

using testing::AllOf;
using testing::HasSubstr;

}  // namespace stillmap::test
