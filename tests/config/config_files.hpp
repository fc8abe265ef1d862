#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "config/loaders/config_error.hpp"

namespace stillmap::test {

/// The repository's config folder.
inline std::filesystem::path shipped(const std::string& file) {
  return std::filesystem::path(STILLMAP_CONFIG_FOLDER) / file;
}

/// A fresh folder of the running test.
inline std::filesystem::path test_folder() {
  const auto* const test = ::testing::UnitTest::GetInstance()->current_test_info();
  const std::filesystem::path folder = std::filesystem::path(::testing::TempDir()) /
                                       (std::string(test->test_suite_name()) + "." + test->name());
  std::filesystem::create_directories(folder);
  return folder;
}

inline std::filesystem::path write_file(const std::string& name, const std::string& content) {
  const std::filesystem::path file = test_folder() / name;
  std::ofstream(file, std::ios::binary) << content;
  return file;
}

/// What `load` says when it refuses; empty when it does not.
template <typename Load>
std::string refusal(const Load& load) {
  try {
    load();
    return {};
  } catch (const ConfigError& error) {
    EXPECT_FALSE(error.faults().empty());
    return error.what();
  }
}

}  // namespace stillmap::test
