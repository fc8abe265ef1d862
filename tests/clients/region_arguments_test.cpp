#include "clients/commands/query/region_arguments.hpp"

#include <fstream>
#include <limits>

#include "tests/clients/command_test.hpp"

namespace stillmap::test {
namespace {

class RegionArgumentsTest : public CommandTest {
 protected:
  static void expect_refused(const std::vector<std::string>& words, const std::string& named) {
    try {
      static_cast<void>(cli::parse_points_2d("--polygon", words));
      FAIL() << named;
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("--polygon"), HasSubstr(named)));
    }
  }
};

TEST_F(RegionArgumentsTest, ReadsPositionsFromWordsAndFiles) {
  const std::vector<Eigen::Vector2d> points{{1.0, -2.5}, {3e1, 4.0}};
  EXPECT_EQ(cli::parse_points_2d("--polygon", {"1", "-2.5", "3e1", "4"}), points);
  write("points.txt", "# x y\n1 -2.5\n\n 30.0,4.0 # the second\n");
  EXPECT_EQ(cli::parse_points_2d("--polygon", {path("points.txt")}), points);
  write("empty.txt", "");
  EXPECT_TRUE(cli::parse_points_2d("--polygon", {path("empty.txt")}).empty());
}

TEST_F(RegionArgumentsTest, NamesWhatIsWrongAndWhere) {
  expect_refused({"1", "2", "3"}, "3 numbers");
  expect_refused({"5"}, "1 numbers");
  expect_refused({"1", "two"}, "'two' is not a number");
  expect_refused({"nowhere.txt"}, "nowhere.txt");
  write("points.txt", "1 2\n3\n");
  expect_refused({path("points.txt")}, "points.txt line 2: '3' is not two numbers");
  write("points.txt", "1 2 3\n");
  expect_refused({path("points.txt")}, "line 1");
}

TEST_F(RegionArgumentsTest, ChecksRegionsBeforeAnybodyIsAsked) {
  cli::RegionArguments region;
  EXPECT_NO_THROW(cli::check_region(region));
  region.sphere = {0, 0, 0, 5};
  EXPECT_NO_THROW(cli::check_region(region));
  region.sphere[3] = 0;
  EXPECT_THROW(cli::check_region(region), std::invalid_argument);
  region = {};
  region.corridor = {"0", "0", "9", "9"};
  EXPECT_THROW(cli::check_region(region), std::invalid_argument);
  region.width_m = 2.0;
  EXPECT_NO_THROW(cli::check_region(region));
  region.min_z_m = 5.0;
  region.max_z_m = 1.0;
  EXPECT_THROW(cli::check_region(region), std::invalid_argument);
}

TEST_F(RegionArgumentsTest, NamesAFolderAndASquareWithoutASize) {
  expect_refused({folder_.string()}, folder_.string() + ": is a folder");
  for (const double size_m : {-5.0, 0.0, std::numeric_limits<double>::quiet_NaN()}) {
    cli::RegionArguments region;
    region.around = {0.0, 0.0, size_m};
    try {
      cli::check_region(region);
      FAIL() << size_m;
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("--around"), HasSubstr("above 0 m")));
    }
  }
}

}  // namespace
}  // namespace stillmap::test
