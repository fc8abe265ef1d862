#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "config/loaders/model_file.hpp"
#include "config/loaders/robot_profile.hpp"
#include "config/loaders/sensor_file.hpp"
#include "config/loaders/server_config.hpp"
#include "tests/config/config_files.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;
using test::refusal;
using test::write_file;
using ::testing::HasSubstr;

/// Every way of reading a file must refuse this one and name it.
void expect_refused(const fs::path& file, const std::string& reason) {
  const std::string of_server = refusal([&] { (void)load_server_config(file); });
  EXPECT_THAT(of_server, HasSubstr(file.string()));
  EXPECT_THAT(of_server, HasSubstr(reason));
  EXPECT_THAT(refusal([&] { (void)load_sensor(file.string()); }), HasSubstr(reason));
  EXPECT_THAT(refusal([&] { (void)read_robot_profile(file); }), HasSubstr(reason));
}

TEST(HostileYaml, MissingFile) {
  expect_refused(test::test_folder() / "missing.yaml", "no such file");
}

TEST(HostileYaml, FolderInsteadOfFile) {
  fs::create_directories(test::test_folder() / "folder.yaml");
  expect_refused(test::test_folder() / "folder.yaml", "is a folder");
}

TEST(HostileYaml, EmptyFile) { expect_refused(write_file("a.yaml", ""), "mapping"); }

TEST(HostileYaml, ScalarOrListInsteadOfFields) {
  expect_refused(write_file("a.yaml", "hello"), "mapping");
  expect_refused(write_file("a.yaml", "- 1\n- 2\n"), "mapping");
}

TEST(HostileYaml, BrokenSyntaxWithItsLine) {
  const fs::path file = write_file("a.yaml", "sensor: hdl_64e\nlabels: {source: [\n");
  expect_refused(file, "not valid YAML");
  expect_refused(file, "a.yaml:");
}

TEST(HostileYaml, HugeNesting) {
  expect_refused(write_file("a.yaml", "sensor: " + std::string(100'000, '[')), "not valid YAML");
  expect_refused(write_file("a.yaml", "sensor: " + std::string(100'000, '{')), "not valid YAML");
}

TEST(HostileYaml, HugeFile) {
  expect_refused(write_file("a.yaml", "# " + std::string(2'000'000, 'x')), "larger than 1 MB");
}

TEST(HostileYaml, SeveralDocuments) {
  expect_refused(write_file("a.yaml", "a: 1\n---\nb: 2\n"), "one document is wanted");
}

TEST(HostileYaml, StrayBracketAfterTheEnd) {
  expect_refused(write_file("a.yaml", "{a: 1} ]\n"), "a.yaml");
}

TEST(HostileYaml, AliasOfItself) {
  expect_refused(write_file("a.yaml", "publish: &a {scan: *a}\n"), "a.yaml");
}

TEST(HostileYaml, BinaryGarbage) {
  std::mt19937 random(11);
  std::uniform_int_distribution<int> any(0, 255);
  for (int round = 0; round < 200; ++round) {
    std::string bytes;
    for (int i = 0; i < 300; ++i) bytes += static_cast<char>(any(random));
    expect_refused(write_file("a.yaml", bytes), "a.yaml");
  }
}

TEST(HostileYaml, GarbageOfPrintableCharacters) {
  std::mt19937 random(12);
  const std::string characters = "{}[]:,&*!|>'\"%@`-?# \nab01~<";
  std::uniform_int_distribution<std::size_t> any(0, characters.size() - 1);
  for (int round = 0; round < 500; ++round) {
    std::string text = "x";
    for (int i = 0; i < 60; ++i) text += characters[any(random)];
    EXPECT_NE(refusal([&] { (void)load_server_config(write_file("a.yaml", text)); }), "") << text;
  }
}

}  // namespace
}  // namespace stillmap
