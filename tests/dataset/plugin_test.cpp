#include "core/dataset/plugin.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace stillmap {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::string refusal(const std::string& part, const std::string& function) {
  try {
    static_cast<void>(plugin_symbol(part, function, "Files are read"));
  } catch (const MissingPlugin& error) {
    return error.what();
  }
  return {};
}

TEST(Plugin, IsFoundBesideTheProgramAndStaysTheSame) {
  void* const address = plugin_symbol("pcd", "stillmap_read_pcd", "PCD files are read");
  EXPECT_NE(address, nullptr);
  EXPECT_EQ(plugin_symbol("pcd", "stillmap_read_pcd", "PCD files are read"), address);
}

TEST(Plugin, ThatIsNotInstalledNamesItsPackage) {
  EXPECT_THAT(refusal("no_such_part", "f"),
              AllOf(HasSubstr("Files are read by stillmap_no_such_part.so"),
                    HasSubstr("stillmap-formats")));
}

TEST(Plugin, WithoutTheFunctionIsRefused) {
  EXPECT_THAT(refusal("pcd", "no_such_function"), HasSubstr("no_such_function"));
}

}  // namespace
}  // namespace stillmap
