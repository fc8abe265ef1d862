#include <algorithm>
#include <cstring>
#include <sstream>
#include <vector>

#include "config/loaders/sensor_file.hpp"
#include "core/dataset/kitti_files.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "tests/clients/command_test.hpp"
#include "tests/dataset/kitti_lidar_scan.hpp"
#include "tests/slowdown.hpp"

namespace stillmap::test {
namespace {

class DatasetCommandTest : public CommandTest {
 protected:
  [[nodiscard]] nlohmann::json run_json(const std::string& arguments) const {
    const ProcessResult result = run(arguments + " --json");
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return nlohmann::json::parse(result.out, nullptr, false);
  }
  /// Compared without printing megabytes when they differ.
  [[nodiscard]] bool same(const std::string& a, const std::string& b) const {
    return content(a) == content(b) && !content(a).empty();
  }
  [[nodiscard]] std::vector<std::string> lines(const std::string& name) const {
    std::istringstream text(content(name));
    std::vector<std::string> lines;
    for (std::string line; std::getline(text, line);) lines.push_back(line);
    return lines;
  }
  /// Name of a scan's files.
  static std::string stem(std::size_t number) {
    const std::string digits = std::to_string(number);
    return std::string(6 - digits.size(), '0') + digits;
  }
  /// The same coordinates bit by bit; the intensity went through the sensor's units.
  void expect_same_points(const std::string& a, const std::string& b) const {
    const auto read = [&](const std::string& name) {
      const std::string bytes = content(name);
      std::vector<float> values(bytes.size() / sizeof(float));
      std::memcpy(values.data(), bytes.data(), values.size() * sizeof(float));
      return values;
    };
    const std::vector<float> values_a = read(a), values_b = read(b);
    ASSERT_EQ(values_a.size(), values_b.size());
    for (std::size_t i = 0; i < values_a.size(); ++i) {
      ASSERT_NEAR(values_a[i], values_b[i], i % 4 == 3 ? 1e-6 : 0.0) << i;
    }
  }
  void remove(const std::string& name) const { std::filesystem::remove_all(folder_ / name); }
};

TEST_F(DatasetCommandTest, ALabelledRecordingGoesThroughAllStepsWithoutLoss) {
  simulate("city", 4);
  const nlohmann::json exported = run_json("dataset export " + path("city") + " " + path("copy"));
  EXPECT_EQ(exported.at("scans"), 4);
  EXPECT_EQ(exported.at("label_source"), "stream");
  for (const char* file : {"velodyne/000003.bin", "labels/000003.label", "times.txt"}) {
    EXPECT_TRUE(same(std::string("copy/") + file, std::string("city/") + file)) << file;
  }
  EXPECT_EQ(line_count("copy/poses.txt"), 4U);
  EXPECT_THAT(content("copy/calib.txt"), HasSubstr("Tr: "));

  const std::string cloud = path("city.ply");
  const nlohmann::json merged = run_json("dataset aggregate " + path("copy") + " " + cloud);
  EXPECT_EQ(merged.at("points"), exported.at("points"));
  const nlohmann::json scattered = run_json("dataset scatter " + cloud + " " + path("copy"));
  EXPECT_EQ(scattered.at("points_in_cloud"), exported.at("points"));
  EXPECT_EQ(scattered.at("labels_changed"), 0);
  EXPECT_TRUE(same("copy/labels/000002.label", "city/labels/000002.label"));
  EXPECT_FALSE(exists("copy/labels.bak"));
}

TEST_F(DatasetCommandTest, LabelsComeBackFromTheCloudAlone) {
  simulate("city", 2);
  ASSERT_EQ(run("dataset aggregate " + path("city") + " " + path("city.ply")).exit_code, 0);
  const std::string before = content("city/labels/000001.label");
  remove("city/labels");
  const ProcessResult result = run("dataset scatter " + path("city.ply") + " " + path("city"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("labels changed in 2 scans"));
  EXPECT_TRUE(content("city/labels/000001.label") == before);
}

TEST_F(DatasetCommandTest, PosesAreOurOdometrysInTheCameraFrame) {
  simulate("city", 5);
  ASSERT_EQ(run("dataset export " + path("city") + " " + path("copy")).exit_code, 0);
  EXPECT_NE(content("copy/poses.txt"), content("city/poses.txt"));
  const nlohmann::json error = run_json("evaluate trajectory --truth " + path("city/poses.txt") +
                                        " --estimate " + path("copy/poses.txt"));
  EXPECT_LT(error.at("ate_unaligned_rmse_m"), 0.3);
}

TEST_F(DatasetCommandTest, WithoutLabelsEveryPointIsUnlabeled) {
  simulate("city", 2);
  remove("city/labels");
  const nlohmann::json exported =
      run_json("dataset export " + path("city") + " " + path("copy") + " --labels none");
  EXPECT_EQ(exported.at("labelled_points"), 0);
  const std::string labels = content("copy/labels/000001.label");
  EXPECT_EQ(labels.size() * 4, content("copy/velodyne/000001.bin").size());
  EXPECT_EQ(labels.find_first_not_of('\0'), std::string::npos);
}

TEST_F(DatasetCommandTest, TheModelGuessesTheLabelsOfARecordingWithoutAny) {
  simulate("city", 2);
  remove("city/labels");
  const nlohmann::json exported = run_json("dataset export " + path("city") + " " + path("copy"));
  EXPECT_EQ(exported.at("label_source"), "street");
  EXPECT_GT(exported.at("labelled_points"), 1000);
}

TEST_F(DatasetCommandTest, EveryScanAndPointIsWrittenEvenWhenOdometryCannotUseThem) {
  simulate("city", 3);
  std::filesystem::resize_file(folder_ / "city/velodyne/000001.bin", 16 * 20);
  std::filesystem::resize_file(folder_ / "city/labels/000001.label", 4 * 20);
  std::filesystem::resize_file(folder_ / "city/rings/000001.bin", 2 * 20);
  const ProcessResult result = run("dataset export " + path("city") + " " + path("copy"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("000001.bin"));
  EXPECT_THAT(result.out, HasSubstr("1 scans with the pose of the scan before"));
  EXPECT_TRUE(same("copy/velodyne/000001.bin", "city/velodyne/000001.bin"));
  EXPECT_EQ(line_count("copy/poses.txt"), 3U);
}

TEST_F(DatasetCommandTest, PointsOfKittisLidarAreWrittenAsTheyAreAndCorrectedOnce) {
  for (const double way_m : {0.0, 0.5}) {
    std::filesystem::create_directories(folder_ / "drive");
    for (const char* name : {"drive/000000.bin", "drive/000001.bin", "drive/000002.bin"})
      write_kitti_bin(folder_ / name, draw({.way_m = way_m}));
    const ProcessResult exported =
        run("dataset export " + path("drive") + " " + path("copy") + " --labels none --force");
    ASSERT_EQ(exported.exit_code, 0) << exported.err;
    expect_same_points("drive/000001.bin", "copy/velodyne/000001.bin");
    const ScanDataset before(folder_ / "drive"), after(folder_ / "copy");
    ASSERT_TRUE(before.kitti_lidar() && after.kitti_lidar());
    EXPECT_EQ(before.read(1).scan.points_lidar, after.read(1).scan.points_lidar);
    EXPECT_EQ(before.read(1).scan.time_offset_s, after.read(1).scan.time_offset_s);
  }
}

TEST_F(DatasetCommandTest, RefusesToExportWithAFileOfSeveralLidars) {
  simulate("city", 2);
  const auto lidar = [](const std::string& name, const std::string& x_m) {
    return "{name: " + name + ", topic: " + name + "/points, sensor: vlp_16, xyz_m: [" + x_m +
           ", 0, 1], rpy_deg: [0, 0, 0]}";
  };
  write("server.yaml", "frames: {base: base_link}\nsensors: [" + lidar("front", "1") + ", " +
                           lidar("rear", "-1") + "]\n");
  const std::string to_copy = "dataset export " + path("city") + " " + path("copy") +
                              " --labels none --config " + path("server.yaml");
  const ProcessResult refused = run(to_copy);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("server.yaml"), HasSubstr("'sensors'")));
  EXPECT_FALSE(exists("copy"));
  ASSERT_EQ(run(to_copy + " --sensor vlp_16").exit_code, 0);
  EXPECT_EQ(ScanDataset(path("copy")).size(), 2U);
}

TEST_F(DatasetCommandTest, DoesNotWriteOverAnythingUnlessForced) {
  simulate("city", 2);
  const std::string to_copy = "dataset export " + path("city") + " " + path("copy");
  ASSERT_EQ(run(to_copy).exit_code, 0);
  write("copy/notes.txt", "mine");
  const ProcessResult again = run(to_copy + " --scans 1");
  EXPECT_EQ(again.exit_code, 2);
  EXPECT_THAT(again.err, AllOf(HasSubstr(path("copy")), HasSubstr("--force")));
  ASSERT_EQ(run(to_copy + " --scans 1 --force").exit_code, 0);
  EXPECT_FALSE(exists("copy/velodyne/000001.bin"));
  EXPECT_FALSE(exists("copy/labels/000001.label"));
  EXPECT_EQ(content("copy/notes.txt"), "mine");
  EXPECT_EQ(run("dataset export " + path("city") + " " + path("city") + " --force").exit_code, 2);
  // A part of what would be replaced.
  for (const char* part : {"city/velodyne", "city/velodyne/000000.bin", "copy/../city/velodyne"}) {
    const ProcessResult of_part =
        run("dataset export " + path(part) + " " + path("city") + " --labels none --force");
    EXPECT_EQ(of_part.exit_code, 2) << part;
    EXPECT_THAT(of_part.err, HasSubstr("the source stays as it is")) << part;
  }
  // What links lead to is another folder's, too.
  std::filesystem::create_directories(folder_ / "linked/velodyne");
  std::filesystem::create_directories(folder_ / "labelled/velodyne");
  std::filesystem::create_directory_symlink(folder_ / "city/velodyne", folder_ / "view");
  std::filesystem::create_symlink(folder_ / "city/velodyne/000000.bin",
                                  folder_ / "linked/velodyne/000000.bin");
  std::filesystem::copy_file(folder_ / "city/velodyne/000000.bin",
                             folder_ / "labelled/velodyne/000000.bin");
  std::filesystem::create_directory_symlink(folder_ / "city/labels", folder_ / "labelled/labels");
  for (const char* linked : {"view", "linked", "labelled"}) {
    const ProcessResult of_link =
        run("dataset export " + path(linked) + " " + path("city") + " --labels none --force");
    EXPECT_EQ(of_link.exit_code, 2) << linked;
    EXPECT_THAT(of_link.err, HasSubstr("the source stays as it is")) << linked;
  }
  EXPECT_TRUE(exists("city/velodyne/000001.bin"));
  EXPECT_TRUE(exists("city/labels/000001.label"));

  const std::string to_cloud = "dataset aggregate " + path("city") + " " + path("city.ply");
  ASSERT_EQ(run(to_cloud).exit_code, 0);
  EXPECT_EQ(run(to_cloud).exit_code, 2);
  EXPECT_EQ(run(to_cloud + " --force").exit_code, 0);
}

TEST_F(DatasetCommandTest, SaysOfWhichLidarASequenceIs) {
  simulate("city", 2);
  EXPECT_EQ(load_sensor(path("city/sensor.yaml")).name, "VLP-16");
  const std::string to_copy = "dataset export " + path("city") + " " + path("copy");
  ASSERT_EQ(run(to_copy).exit_code, 0);
  EXPECT_EQ(load_sensor(path("copy/sensor.yaml")).rings, 16);
  ASSERT_EQ(run(to_copy + " --sensor hdl_32e --force").exit_code, 0);
  EXPECT_EQ(load_sensor(path("copy/sensor.yaml")).name, "HDL-32E");
}

TEST_F(DatasetCommandTest, RefusesClassesThatWouldBeReadAsIdsUntilItIsToldWhatTheyAre) {
  simulate("city", 2);
  const std::vector<std::uint32_t> ids = read_kitti_labels(
      path("city/labels/000000.label"), content("city/labels/000000.label").size() / 4);
  for (const char* scan : {"0", "1"}) {
    const std::string file = std::string("city/labels/00000") + scan + ".label";
    auto labels = read_kitti_labels(path(file), content(file).size() / 4);
    for (std::uint32_t& label : labels)
      label = static_cast<std::uint32_t>(class_from_semantic_kitti(label & 0xFFFFU));
    // As data sets of classes have them: "ignore", and an instance.
    labels[0] = labels[1] = 255;
    labels[2] |= 7U << 16U;
    write_kitti_labels(path(file), labels);
  }
  const std::string to_copy = "dataset export " + path("city") + " " + path("copy");
  for (const std::string& command : {to_copy, "map " + path("city") + " --out " + path("map")}) {
    const ProcessResult refused = run(command);
    EXPECT_EQ(refused.exit_code, 2) << command;
    EXPECT_THAT(refused.err, HasSubstr("--label-kind classes"));
  }
  ASSERT_EQ(run(to_copy + " --label-kind classes").exit_code, 0);
  const auto copied = read_kitti_labels(path("copy/labels/000000.label"), ids.size());
  for (std::size_t i = 2; i < ids.size(); ++i)
    ASSERT_EQ(class_from_semantic_kitti(copied[i] & 0xFFFFU),
              class_from_semantic_kitti(ids[i] & 0xFFFFU));
}

TEST_F(DatasetCommandTest, LabelsByTheModelWhatComesWithoutLabels) {
  simulate("city", 4);
  std::filesystem::remove(path("city/labels/000002.label"));
  const auto mapped = [&](const std::string& labels) {
    const ProcessResult result =
        run("map " + path("city") + " --out " + path("map_") + labels + " --labels " + labels);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result;
  };
  EXPECT_THAT(mapped("auto").out, HasSubstr("labels: the recording's own, else street"));
  const ProcessResult without = mapped("files");
  EXPECT_THAT(without.out, HasSubstr("labels: the recording's own;"));
  EXPECT_THAT(without.err, HasSubstr("some scans have no labels"));
}

TEST_F(DatasetCommandTest, ExportSaysWhereLabelsComeFrom) {
  simulate("city", 2);
  const std::string to_copy = "dataset export " + path("city") + " " + path("copy") + " --force";
  EXPECT_THAT(run(to_copy + " --labels none").out, HasSubstr("with a label from 'stream')"));
  std::filesystem::remove(path("city/labels/000001.label"));
  EXPECT_THAT(run(to_copy + " --labels none").out,
              HasSubstr("with a label from 'stream, else none')"));
  std::filesystem::remove_all(path("city/labels"));
  EXPECT_THAT(run(to_copy + " --labels none").out, HasSubstr("(0 with a label from 'none')"));
}

TEST_F(DatasetCommandTest, ScansOfADriveVoteOnTheLabelsThatAreExported) {
  simulate("city", 8);
  std::filesystem::create_directories(path("truth"));
  std::filesystem::rename(path("city/labels"), path("truth/labels"));
  const auto accuracy = [&](const std::string& more) {
    const ProcessResult exported = run("dataset export " + path("city") + " " + path("out") +
                                       " --force --labels model --columns 512" + more);
    EXPECT_EQ(exported.exit_code, 0) << exported.err;
    const ProcessResult result = run("evaluate segmentation --json --truth " + path("truth") +
                                     " --predictions " + path("out/labels"));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_TRUE(exists("out/labels/000007.label"));
    return nlohmann::json::parse(result.out).at("accuracy").get<double>();
  };
  EXPECT_GT(accuracy(""), accuracy(" --drive-votes off") + 0.005);
}

TEST_F(DatasetCommandTest, NamesWhatItCannotUse) {
  simulate("city", 2);
  const auto refusal = [&](const std::string& arguments) {
    const ProcessResult result = run("dataset " + arguments);
    EXPECT_EQ(result.exit_code, 2) << arguments;
    return result.err;
  };
  EXPECT_THAT(refusal("export " + path("nowhere") + " " + path("out")), HasSubstr("nowhere"));
  EXPECT_THAT(refusal("export topic:points " + path("out") + " --silence 3"),
              HasSubstr("--idle-timeout"));
  EXPECT_THAT(refusal("aggregate " + path("city") + " " + path("c.ply") + " --from 7"),
              HasSubstr("from 7"));
  write("foreign.ply",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n");
  EXPECT_THAT(refusal("scatter " + path("foreign.ply") + " " + path("city")),
              AllOf(HasSubstr("foreign.ply"), HasSubstr("\"label\"")));
  EXPECT_THAT(refusal("scatter " + path("gone.ply") + " " + path("city")), HasSubstr("gone.ply"));
}

TEST_F(DatasetCommandTest, ALiveTopicBecomesASequence) {
  simulate("city", 12);
  const std::string on_domain = " --domain " + std::to_string(free_domain());
  BackgroundProcess server(stillmap_server_program() + " --delivery every" + on_domain,
                           folder_ / "server.log");
  BackgroundProcess exporting(stillmap_program() + " dataset export topic:points " + path("live") +
                                  " --idle-timeout " + std::to_string(3 * slowdown) +
                                  " --sensor vlp_16 --json" + patiently() + on_domain,
                              folder_ / "export.log");
  ASSERT_TRUE(comes_to_contain("export.log", "waiting for scans")) << content("export.log");
  ASSERT_EQ(run("status" + patiently() + on_domain).exit_code, 0) << content("server.log");
  ASSERT_EQ(run("replay " + path("city") + " --rate " + std::to_string(0.5 / slowdown) + on_domain)
                .exit_code,
            0);
  ASSERT_EQ(exporting.wait(), 0) << content("export.log");
  const std::vector<std::string> live_times = lines("live/times.txt");
  const std::vector<std::string> city_times = lines("city/times.txt");
  // The first scans may be lost before discovery is complete.
  ASSERT_GE(live_times.size(), 6U) << content("export.log");
  for (std::size_t k = 0; k < live_times.size(); ++k) {
    const auto found = std::ranges::find(city_times, live_times[k]);
    ASSERT_NE(found, city_times.end());
    const auto number = static_cast<std::size_t>(found - city_times.begin());
    expect_same_points("live/velodyne/" + stem(k) + ".bin",
                       "city/velodyne/" + stem(number) + ".bin");
    EXPECT_EQ(content("live/labels/" + stem(k) + ".label").size(),
              content("city/labels/" + stem(number) + ".label").size());
  }
  EXPECT_EQ(line_count("live/poses.txt"), live_times.size());
  EXPECT_EQ(load_sensor(path("live/sensor.yaml")).rings, 16) << "told by the scans alone";
  // The labels of the stream return as those of the server.
  const std::string log = content("export.log");
  EXPECT_GT(nlohmann::json::parse(log.substr(log.find("\n{"))).at("labelled_points"), 10'000);
}

TEST_F(DatasetCommandTest, ALiveExportThatGetsNoPosesSaysSo) {
  simulate("city", 3);
  const std::string on_domain = " --domain " + std::to_string(free_domain());
  BackgroundProcess server(stillmap_server_program() + on_domain, folder_ / "server.log");
  BackgroundProcess exporting(stillmap_program() + " dataset export topic:other " + path("live") +
                                  " --idle-timeout 1" + patiently() + on_domain,
                              folder_ / "export.log");
  ASSERT_TRUE(comes_to_contain("export.log", "waiting for scans")) << content("export.log");
  ASSERT_EQ(run("status" + patiently() + on_domain).exit_code, 0) << content("server.log");
  ASSERT_EQ(run("replay " + path("city") + " --topic other" + on_domain).exit_code, 0);
  EXPECT_EQ(exporting.wait(), 1);
  EXPECT_THAT(content("export.log"), HasSubstr("the server did not map"));
}

TEST_F(DatasetCommandTest, SensorFindsTheOffsetOfElevationsFromADrive) {
  simulate("drive", 20);
  const ProcessResult found =
      run("dataset sensor " + path("drive") + " --calibrate --out " + path("lidar.yaml"));
  ASSERT_EQ(found.exit_code, 0) << found.err;
  EXPECT_THAT(found.out, HasSubstr("occupied voxels"));
  EXPECT_THAT(found.out, HasSubstr("elevation offset: "));
  EXPECT_THAT(content("lidar.yaml"), HasSubstr("elevation_offset_deg: "));
  simulate("short", 5);
  const ProcessResult refused = run("dataset sensor " + path("short") + " --calibrate");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("20 scans or more, not of 5"));
}

TEST_F(DatasetCommandTest, ExportsTheSamplesOfImuAndGnss) {
  simulate("city", 30, " --imu --gnss 1");
  const nlohmann::json whole =
      run_json("dataset export " + path("city") + " " + path("copy") + " --labels none");
  EXPECT_TRUE(same("copy/imu.csv", "city/imu.csv"));
  EXPECT_TRUE(same("copy/gnss.csv", "city/gnss.csv"));
  EXPECT_EQ(whole.at("imu_samples"), line_count("city/imu.csv") - 1);
  // Of a part: those of its time.
  const ProcessResult part = run("dataset export " + path("city") + " " + path("part") +
                                 " --labels none --start 25 --scans 2");
  ASSERT_EQ(part.exit_code, 0) << part.err;
  EXPECT_THAT(part.out, AllOf(HasSubstr("imu.csv"), HasSubstr("gnss.csv")));
  EXPECT_LT(line_count("part/imu.csv"), line_count("city/imu.csv") - 200);
  EXPECT_GT(line_count("part/imu.csv"), 200U);
}

TEST_F(DatasetCommandTest, ExportLabelsScansOfALidarThatSitsAsTheServersFileSays) {
  ASSERT_EQ(run("simulate " + path("leaning") + " --sensor vlp_16 --scans 1 --mount 0,0,1.7,0,15,0")
                .exit_code,
            0);
  std::filesystem::copy(folder_ / "leaning", folder_ / "bare",
                        std::filesystem::copy_options::recursive);
  remove("bare/labels");
  const std::string base = "frames: {base: base_link}\nlabels: {stance: mount}\n";
  write("leaning.yaml", base + "mount: {xyz_m: [0, 0, 1.7], rpy_deg: [0, 15, 0]}\n");
  write("upright.yaml", base);
  write("elsewhere.yaml", base + "mount: {source: tf_static}\n");
  std::string said;
  const auto accuracy = [&](const std::string& config) {
    const ProcessResult exported =
        run("dataset export " + path("bare") + " " + path("copy") +
            " --force --labels model --columns 512 --sensor vlp_16 --config " + path(config));
    EXPECT_EQ(exported.exit_code, 0) << exported.err;
    said = exported.err;
    return run_json("evaluate segmentation --truth " + path("leaning") + " --predictions " +
                    path("copy/labels"))
        .at("accuracy")
        .get<double>();
  };
  const double upright = accuracy("upright.yaml");
  EXPECT_THAT(said, Not(HasSubstr("/tf_static")));
  EXPECT_GT(accuracy("leaning.yaml"), upright + 0.1);
  EXPECT_EQ(accuracy("elsewhere.yaml"), upright);
  EXPECT_THAT(said, HasSubstr("/tf_static"));
}

TEST_F(DatasetCommandTest, ExportLeavesNoPartOfAnotherSequence) {
  simulate("city", 2);
  const std::string to_copy =
      "dataset export " + path("city") + " " + path("copy") + " --labels none";
  std::filesystem::create_directories(folder_ / "copy");
  write("copy/poses_lidar.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n");
  write("copy/imu.csv", "1,0,0,0,0,0,9.81\n");
  const ProcessResult refused = run(to_copy);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("poses_lidar.txt"), HasSubstr("--force")));
  EXPECT_FALSE(exists("copy/velodyne"));
  const ProcessResult forced = run(to_copy + " --force");
  ASSERT_EQ(forced.exit_code, 0) << forced.err;
  EXPECT_FALSE(exists("copy/poses_lidar.txt"));
  EXPECT_FALSE(exists("copy/imu.csv"));
}

TEST_F(DatasetCommandTest, SensorIsNotNamedFromScansWithoutPoints) {
  write("nothing.pcd",
        "VERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
        "WIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA ascii\n"
        "nan nan nan 0.5\nnan nan nan 0.5\n");
  const ProcessResult refused =
      run("dataset sensor " + path("nothing.pcd") + " --out " + path("lidar.yaml"));
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("nothing.pcd"), HasSubstr("no scan with a finite")));
  EXPECT_FALSE(exists("lidar.yaml"));
}

TEST_F(DatasetCommandTest, ReadsTheFieldsThatTheServersFileNames) {
  write("a.ply",
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
        "property float z\nproperty float intensity\nproperty uchar brightness\nend_header\n"
        "5 0 0 0.25 0\n0 6 0 0.5 255\n");
  write("server.yaml", "input: {fields: {intensity: [brightness]}}\n");
  const std::string to_copy =
      "dataset export " + path("a.ply") + " " + path("copy") + " --labels none --force";
  EXPECT_THAT(run(to_copy).err, HasSubstr("intensity from intensity (float32), no time"));
  EXPECT_FLOAT_EQ(ScanDataset(path("copy")).read(0).scan.intensity.at(0), 0.25F);
  EXPECT_THAT(run(to_copy + " --config " + path("server.yaml")).err,
              HasSubstr("intensity from brightness (uint8)"));
  EXPECT_FLOAT_EQ(ScanDataset(path("copy")).read(0).scan.intensity.at(0), 0.0F);
}

}  // namespace
}  // namespace stillmap::test
