#include "core/dataset/bin_layout.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <random>

#include "core/dataset/binary_file.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

constexpr std::size_t beams = 32;

struct Measured {
  float x, y, z, intensity, ring;
};

/// A turn of a lidar of 32 beams on even ground with walls; all beams of a direction before the
/// next, as such lidars measure.
std::vector<Measured> turn(unsigned seed = 1) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> noise(-0.02F, 0.02F), brightness(0.0F, 0.6F);
  std::vector<Measured> points;
  for (int step = 0; step < 200; ++step) {
    const float azimuth = 0.0314F * static_cast<float>(step);
    for (std::size_t beam = 0; beam < beams; ++beam) {
      const float elevation = -0.53F + 0.0232F * static_cast<float>(beam);
      const float wall = 12.0F + 8.0F * std::sin(3.0F * azimuth);
      const float ground = elevation < 0.0F ? 1.8F / std::sin(-elevation) : 1e9F;
      const float range = std::min(wall / std::cos(elevation), ground) + noise(random);
      points.push_back({range * std::cos(elevation) * std::cos(azimuth),
                        range * std::cos(elevation) * std::sin(azimuth),
                        range * std::sin(elevation), std::round(255.0F * brightness(random)),
                        static_cast<float>(beam)});
    }
  }
  return points;
}

/// The first so many values of every point.
template <class T = float>
std::vector<T> values_of(const std::vector<Measured>& points, std::size_t values,
                         float brightest = 255.0F) {
  std::vector<T> all;
  for (const Measured& p : points) {
    const std::array<float, 7> of_point{p.x,    p.y,        p.z, p.intensity * brightest / 255.0F,
                                        p.ring, 0.1F * p.x, 3.0F};
    for (std::size_t k = 0; k < values; ++k) all.push_back(static_cast<T>(of_point[k]));
  }
  return all;
}

class BinLayoutTest : public testing::Test {
 protected:
  template <class T>
  fs::path write(const std::vector<T>& values, const std::string& name = "000000.bin") {
    write_values<T>(folder_ / name, values);
    return folder_ / name;
  }
  template <class T>
  std::string fault(const std::vector<T>& values) {
    const fs::path file = write(values);
    return message_of<DatasetError>([&] { (void)ScanDataset(file); });
  }
  template <class T>
  bool is_kittis(const std::vector<T>& values) {
    const std::array files{write(values)};
    return bin_layout_of(files) == BinLayout::kitti;
  }

  ScratchFolder folder_;
};

TEST_F(BinLayoutTest, ReadsNuscenesWithItsRings) {
  const std::vector<Measured> points = turn();
  write(values_of(points, 5), "n015__LIDAR_TOP__1532402927647951.pcd.bin");
  write(values_of(turn(2), 5), "n015__LIDAR_TOP__1532402927747951.pcd.bin");
  const ScanDataset dataset(folder_.path());
  const Scan scan = dataset.read(0).scan;
  ASSERT_EQ(scan.size(), points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    ASSERT_EQ(scan.points_lidar[i], Eigen::Vector3f(points[i].x, points[i].y, points[i].z));
    ASSERT_NEAR(scan.intensity[i], points[i].intensity / 255.0F, 1e-4F);
    ASSERT_EQ(scan.ring[i], static_cast<std::uint16_t>(points[i].ring));
  }
  EXPECT_EQ(dataset.suggested_sensor().rings, 32);
  EXPECT_EQ(dataset.stamp_ns(0), 1532402927647951000);
  EXPECT_THAT(dataset.remarks(), testing::ElementsAre(HasSubstr("nuScenes")));
  // Whatever the file is called.
  EXPECT_EQ(ScanDataset(write(values_of(points, 5))).read(0).scan.ring, scan.ring);
}

TEST_F(BinLayoutTest, RefusesOtherLayoutsWithTheWayOut) {
  EXPECT_THAT(fault(values_of(turn(), 3)),
              AllOf(HasSubstr("000000.bin: looks like x y z as float32"), HasSubstr("np.pad")));
  EXPECT_THAT(fault(values_of(turn(), 6)),
              AllOf(HasSubstr("6 values of float32"), HasSubstr("reshape(-1, 6)[:, :4]")));
  EXPECT_THAT(fault(values_of(turn(), 7)), HasSubstr("7 values of float32"));
  EXPECT_THAT(fault(values_of<double>(turn(), 4)), AllOf(HasSubstr("float64"), HasSubstr("'f8'")));
  // The fifth may be a time.
  std::vector<float> timed = values_of(turn(), 5);
  for (std::size_t i = 4; i < timed.size(); i += 5) timed[i] = 0.000003F * static_cast<float>(i);
  EXPECT_THAT(fault(timed), HasSubstr("5 values of float32"));
}

// As Ouster's of HeLiPR: x y z intensity, nanoseconds, three numbers of 16 bits.
TEST_F(BinLayoutTest, RefusesRecordsOfOtherNumbers) {
  std::vector<char> bytes;
  std::uint32_t time_ns = 0;
  for (const Measured& p : turn()) {
    const auto append = [&](const auto& value) {
      const auto* begin = reinterpret_cast<const char*>(&value);
      bytes.insert(bytes.end(), begin, begin + sizeof value);
    };
    for (const float value : {p.x, p.y, p.z, p.intensity}) append(value);
    append(time_ns += 15'000);
    for (const std::uint16_t value : std::array<std::uint16_t, 3>{7, 12, 300}) append(value);
  }
  EXPECT_THAT(fault(bytes), HasSubstr("26 bytes a point"));
}

// As RobotCar's: x of all points, then y, z and the intensities.
TEST_F(BinLayoutTest, RefusesColumnsOneAfterTheOther) {
  const std::vector<float> points = values_of(turn(), 4);
  std::vector<float> columns;
  for (std::size_t k = 0; k < 4; ++k)
    for (std::size_t i = k; i < points.size(); i += 4) columns.push_back(points[i]);
  EXPECT_THAT(fault(columns), AllOf(HasSubstr("all x, then all y"), HasSubstr("reshape(4, -1).T")));
}

// As NCLT's: coordinates of 16 bits, intensity and beam of 8.
TEST_F(BinLayoutTest, RefusesWholeNumbers) {
  std::vector<std::uint16_t> values;
  for (const Measured& p : turn()) {
    for (const float metres : {p.x, p.y, p.z})
      values.push_back(static_cast<std::uint16_t>((metres + 100.0F) / 0.005F));
    values.push_back(static_cast<std::uint16_t>(256.0F * p.ring + p.intensity));
  }
  EXPECT_THAT(fault(values), AllOf(HasSubstr("no float32"), HasSubstr("NCLT"),
                                   testing::Not(HasSubstr("python3"))));
  // Nothing is to be learnt from a scrap.
  values.resize(20);
  EXPECT_TRUE(is_kittis(values));
}

TEST_F(BinLayoutTest, TakesEveryFileOfKittisLayout) {
  for (const float brightest : {1.0F, 255.0F, 0.0F}) {
    std::vector<Measured> points = turn();
    EXPECT_TRUE(is_kittis(values_of(points, 4, brightest)));
    // In no order at all.
    std::ranges::shuffle(points, std::mt19937(1));
    EXPECT_TRUE(is_kittis(values_of(points, 4, brightest)));
    // Two lidars that look into opposite directions take turns.
    for (std::size_t i = 0; i < points.size(); i += 2) points[i].x *= -1.0F, points[i].y *= -1.0F;
    EXPECT_TRUE(is_kittis(values_of(points, 4, brightest)));
    points.resize(20);
    EXPECT_TRUE(is_kittis(values_of(points, 4, brightest)));
  }
  const std::vector<Measured> sound = turn();
  // Missing points, in pairs and out of them.
  for (const std::size_t every : {2, 3, 5}) {
    for (const float missing :
         {0.0F, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
      std::vector<Measured> points = sound;
      for (std::size_t i = 0; i < points.size(); i += every)
        points[i] = {missing, missing, missing, 0.0F, 0.0F};
      EXPECT_TRUE(is_kittis(values_of(points, 4))) << every << " " << missing;
    }
  }
  EXPECT_TRUE(is_kittis(std::vector<float>(4000, 0.0F)));
  EXPECT_TRUE(is_kittis(std::vector<float>{}));
  std::vector<float> whole(8000);
  std::iota(whole.begin(), whole.end(), 0.0F);
  EXPECT_TRUE(is_kittis(whole));
  for (float& value : whole) value = std::fmod(value, 97.0F);
  EXPECT_TRUE(is_kittis(whole));
}

// It is said elsewhere that half of the points are no lidar's.
TEST_F(BinLayoutTest, TakesCoordinatesOfOtherFramesAndUnits) {
  const auto is_taken = [&](auto other) {
    std::vector<Measured> points = turn();
    for (Measured& p : points) other(p);
    return is_kittis(values_of(points, 4)) && is_kittis(values_of(points, 4, 0.0F));
  };
  EXPECT_TRUE(is_taken([](Measured& p) { p.x += 458'000.0F, p.y += 5'428'000.0F; })) << "UTM";
  EXPECT_TRUE(is_taken([](Measured& p) {
    p.x += 4'157'000.0F, p.y += 664'000.0F, p.z += 4'774'000.0F;
  })) << "ECEF";
  EXPECT_TRUE(is_taken([](Measured& p) { p.x *= 1e6F, p.y *= 1e6F, p.z *= 1e6F; })) << "um";
}

TEST_F(BinLayoutTest, TakesFilesOfWhichMostPointsAreMissing) {
  for (const float missing : {1e9F, std::numeric_limits<float>::max()}) {
    std::vector<Measured> points = turn();
    for (std::size_t i = 0; i < points.size(); ++i)
      if (i % 10 != 0) points[i] = {missing, missing, missing, 0.0F, 0.0F};
    EXPECT_TRUE(is_kittis(values_of(points, 4))) << missing;
  }
}

/// A corridor of 20 m along y by 1 m, its points in no order.
std::vector<Measured> corridor(float brightest) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> along(-10.0F, 10.0F), across(-0.5F, 0.5F), up(-0.6F, 1.4F),
      brightness(0.0F, 1.0F);
  std::vector<Measured> points;
  for (int k = 0; k < 6848; ++k) {
    const float wall = k % 2 == 0 ? -0.5F : 0.5F;
    const bool is_floor = k % 3 == 0;
    points.push_back({is_floor ? across(random) : wall, along(random),
                      is_floor ? -0.6F : up(random), brightest * brightness(random), 0.0F});
  }
  return points;
}

// Of a column of zeros nothing says which layout it is of, and the others are very unlike.
TEST_F(BinLayoutTest, TakesACorridorInNoOrderWithoutIntensity) {
  for (const float brightest : {0.0F, 255.0F}) {
    for (const std::size_t points : {6840U, 6845U, 6846U, 6848U}) {
      std::vector<Measured> all = corridor(brightest);
      all.resize(points);
      EXPECT_TRUE(is_kittis(values_of(all, 4))) << brightest << " " << points;
    }
  }
  // Nearly all zeros.
  std::vector<Measured> points = corridor(0.0F);
  points.resize(6840);
  for (std::size_t i = 0; i < points.size(); i += 50) points[i].intensity = 200.0F;
  EXPECT_TRUE(is_kittis(values_of(points, 4)));
}

}  // namespace
}  // namespace stillmap
