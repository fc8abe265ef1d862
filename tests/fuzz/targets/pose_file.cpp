// A number that says which kind of file, then the text: poses, times, calib.txt, and file names
// with times in them.

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/file_stamp.hpp"
#include "core/dataset/kitti_files.hpp"
#include "tests/fuzz/byte_source.hpp"
#include "tests/fuzz/invariant.hpp"
#include "tests/fuzz/memory_folder.hpp"

namespace stillmap::fuzz {
// A namespace of its own: every target has helpers of the same names.
namespace pose_file_inputs {
namespace {

enum Kind : std::uint8_t { poses, times, calibration, name, kinds };

void read_all_poses(const std::filesystem::path& file) {
  const std::vector<Eigen::Isometry3d> T_camera0_camera = read_poses(file);
  for (const Eigen::Isometry3d& T : T_camera0_camera) {
    require(T.matrix().allFinite(), "poses are finite");
    require(T.linear().isUnitary(1e-6), "poses are rigid");
  }
  const Eigen::Isometry3d T_camera_lidar(Eigen::AngleAxisd(1.0, Eigen::Vector3d::UnitX()));
  static_cast<void>(lidar_poses_from_camera(T_camera0_camera, T_camera_lidar));
}

void read_name(const std::string& text) {
  static_cast<void>(stamp_ns_from_name(text));
  static_cast<void>(ns_from_seconds(text));
  const std::string front = text.substr(0, text.size() / 2);
  const std::string back = text.substr(text.size() / 2);
  require(!natural_less(front, back) || !natural_less(back, front), "one name comes first");
}

void read(Kind kind, Bytes text) {
  if (kind == name) return read_name(text_of(text));
  const auto file = MemoryFolder::of_this_process().file("poses.txt", text);
  if (kind == poses) read_all_poses(file);
  if (kind == times) static_cast<void>(read_kitti_times(file));
  if (kind == calibration) {
    require(read_kitti_calibration(file).matrix().allFinite(), "a calibration is finite");
  }
}

void run(Bytes bytes) {
  ByteSource source(bytes);
  const auto kind = static_cast<Kind>(source.byte() % kinds);
  try {
    read(kind, source.rest());
  } catch (const DatasetError&) {
  }
}

std::vector<Seed> seeds() {
  const auto& folder = MemoryFolder::of_this_process();
  const Eigen::Isometry3d T(Eigen::Translation3d(1.0, -2.5, 0.25) *
                            Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()));
  const std::vector<Eigen::Isometry3d> two_poses{Eigen::Isometry3d::Identity(), T};
  write_poses(folder.path("seed_poses.txt"), two_poses);
  write_kitti_times_ns(folder.path("seed_times.txt"),
                       std::vector<std::int64_t>{0, 103'736'000, 1'700'000'000'123'456'789});
  write_kitti_calibration(folder.path("seed_calib.txt"), T);
  const auto written = [&](const char* file) { return content_of(folder.path(file)); };
  return {{"poses", with_choice(poses, written("seed_poses.txt"))},
          {"times", with_choice(times, written("seed_times.txt"))},
          {"times_exponents", with_choice(times, "0.000000e+00\n1.037359e-01\n2.1e3\n")},
          {"calibration", with_choice(calibration, written("seed_calib.txt"))},
          {"name", with_choice(name, "1539765928.346003000")},
          {"name_digits", with_choice(name, "1539765928346003000")}};
}

}  // namespace
}  // namespace pose_file_inputs

const Target pose_file_target{"pose_file", pose_file_inputs::run, pose_file_inputs::seeds};

}  // namespace stillmap::fuzz
