#include "core/dataset/scan_dataset.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "core/dataset/binary_file.hpp"
#include "core/dataset/file_stamp.hpp"
#include "core/dataset/gnss_file.hpp"
#include "core/dataset/imu_file.hpp"
#include "core/dataset/kitti_files.hpp"
#include "core/dataset/kitti_sequence_writer.hpp"
#include "core/dataset/point_cloud_files.hpp"
#include "core/dataset/scan_files.hpp"
#include "core/dataset/scan_remarks.hpp"
#include "core/lidar/measured_elevation.hpp"
#include "core/lidar/point_fields.hpp"
#include "core/lidar/ranked_value.hpp"
#include "core/lidar/ring_numbering.hpp"
#include "core/lidar/sensor_fit.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t default_period_ns = 100'000'000;

/// Nothing where one of the names carries none.
std::optional<std::vector<std::int64_t>> stamps_from_names(const std::vector<fs::path>& files) {
  std::vector<std::int64_t> stamps_ns;
  for (const fs::path& file : files) {
    const auto stamp_ns = stamp_ns_from_name(file.stem().string());
    if (!stamp_ns) return std::nullopt;
    stamps_ns.push_back(*stamp_ns);
  }
  return stamps_ns;
}

std::vector<std::int64_t> made_up_stamps(std::size_t scans,
                                         std::int64_t period_ns = default_period_ns) {
  std::vector<std::int64_t> stamps_ns;
  for (std::size_t i = 0; i < scans; ++i) {
    stamps_ns.push_back(static_cast<std::int64_t>(i) * period_ns);
  }
  return stamps_ns;
}

/// Lowest and highest elevation of the points [rad].
std::pair<double, double> field_of_view(const Scan& scan) {
  double low = 0.0, high = 0.0;
  for (const auto& p : scan.points_lidar) {
    const double elevation = measured_elevation(p);
    if (!std::isfinite(elevation)) continue;
    low = std::min(low, elevation);
    high = std::max(high, elevation);
  }
  return {low, high};
}

/// Whether half of the points that were measured lie beyond 150 m: of a lidar in the open the
/// median is some 10 m, and no more than 400 m can be measured at all.
bool is_beyond_a_lidar(const Scan& scan) {
  constexpr float longest_median_m = 150.0F;
  std::size_t measured = 0, beyond = 0;
  for (const Eigen::Vector3f& p : scan.points_lidar) {
    if (!is_measured(p)) continue;
    ++measured;
    beyond += p.norm() > longest_median_m ? 1 : 0;
  }
  return 2 * beyond > measured;
}

SensorModel guess_sensor(const Scan& scan, bool kitti_file) {
  if (auto sensor = fit_sensor(scan)) {
    // KITTI's own, of which somebody has cut away the ground, say.
    const bool is_part_of_kitti = kitti_file && sensor->pattern == ScanPattern::irregular &&
                                  sensor_mismatch(scan, hdl_64e()).empty();
    return is_part_of_kitti ? hdl_64e() : *std::move(sensor);
  }
  if (!scan.ring.empty()) {
    const int rings = ring_numbering(scan).rings;
    return rings <= 16 ? vlp_16() : (rings <= 32 ? hdl_32e() : hdl_64e());
  }
  constexpr double just_above_vlp_16 = 16.0 * std::numbers::pi / 180.0;
  if (kitti_file || scan.empty()) return hdl_64e();
  const auto [low, high] = field_of_view(scan);
  return std::max(-low, high) < just_above_vlp_16 ? vlp_16() : hdl_64e();
}

}  // namespace

ScanDataset::ScanDataset(const fs::path& path, std::optional<LabelKind> label_kind,
                         PointFieldNames fields)
    : files_(scans_of(path)),
      lines_(lines_of(files_)),
      label_kind_(label_kind),
      fields_(std::move(fields)) {
  if (files_.front().parent_path().filename() == "velodyne") {
    sequence_ = files_.front().parent_path().parent_path();
  }
  settle_axes();
  const fs::path times = sequence_ / "times.txt";
  if (!sequence_.empty() && fs::exists(times)) {
    const auto [times_ns, unit] = read_kitti_times(times);
    times_unit_ = unit;
    for (const std::size_t line : lines_in(times, lines_, times_ns.size(), files_)) {
      stamps_ns_.push_back(times_ns[line]);
    }
  } else if (auto stamps_ns = stamps_from_names(files_)) {
    stamps_ns_ = *std::move(stamps_ns);
  } else {
    times_unit_ = TimesUnit::none;
  }
  if (times_unit_ == TimesUnit::none) stamps_ns_ = made_up_stamps(files_.size());
  bin_layout_ = find_bin_layout();
  learn_from_sample();
}

ScanDataset::ScanDataset(std::shared_ptr<const ScanSource> source,
                         std::optional<LabelKind> label_kind)
    : source_(std::move(source)), label_kind_(label_kind) {
  for (std::size_t i = 0; i < source_->size(); ++i) {
    files_.push_back(source_->name(i));
    stamps_ns_.push_back(source_->stamp_ns(i));
  }
  learn_from_sample();
}

void ScanDataset::settle_axes() {
  const PointFieldNames own;
  if (fields_.x == own.x && fields_.y == own.y && fields_.z == own.z) return;
  // What was put right when it was written is not turned back.
  are_axes_ours_ = !sequence_.empty() && fs::exists(sequence_ / axes_file_name);
  if (are_axes_ours_) {
    fields_.x = own.x;
    fields_.y = own.y;
    fields_.z = own.z;
  }
  if (ending_of(files_.front()) == ".bin" && !are_axes(axes_by(fields_)))
    throw DatasetError(files_.front(),
                       "has x, y and z by their order, and the names of these in 'fields' do not "
                       "take each of them once, with or without '-'");
}

std::vector<std::size_t> ScanDataset::sample() const {
  constexpr std::size_t max_samples = 9;
  const std::size_t count = std::min(max_samples, size());
  std::vector<std::size_t> indices;
  for (std::size_t k = 0; k < count; ++k) {
    indices.push_back(count > 1 ? k * (size() - 1) / (count - 1) : 0);
  }
  return indices;
}

BinLayout ScanDataset::find_bin_layout() const {
  if (ending_of(files_.front()) != ".bin") return BinLayout::kitti;
  // What we wrote ourselves.
  for (const char* folder : {"rings", "time_offsets", axes_file_name})
    if (!sequence_.empty() && fs::exists(sequence_ / folder)) return BinLayout::kitti;
  std::vector<fs::path> files;
  for (const std::size_t i : sample()) files.push_back(file(i));
  return bin_layout_of(files);
}

void ScanDataset::learn_from_sample() {
  label_census_ = {};
  has_labels_ = lacks_labels_ = false;
  kitti_lidar_.reset();
  // The first scan of a recording is often part of one, and any may be damaged.
  std::vector<std::pair<std::size_t, std::size_t>> readable;
  std::vector<float> full_scales;
  std::optional<DatasetError> fault;
  const auto count_label = [this](std::uint32_t label) { label_census_.add(label); };
  for (const std::size_t i : sample()) {
    try {
      const DatasetFrame frame = read_unscaled(i);
      if (!label_kind_) std::ranges::for_each(frame.raw_labels, count_label);
      const bool is_labelled = has_known_class(reduced_classes(frame.raw_labels));
      has_labels_ |= is_labelled;
      lacks_labels_ |= !is_labelled && !frame.scan.empty();
      readable.emplace_back(frame.scan.size(), i);
      full_scales.push_back(intensity_full_scale(frame.scan.intensity));
    } catch (const DatasetError& error) {
      if (!fault) fault = error;
    }
  }
  if (readable.empty()) throw DatasetError(*fault);
  std::ranges::sort(readable);
  DatasetFrame typical_frame = read_unscaled(readable[readable.size() / 2].second);
  const Scan& typical = typical_frame.scan;
  is_too_large_ = is_beyond_a_lidar(typical);
  format_ = std::move(typical_frame.format);
  // The brightest but one of many: dark scans say too little, broken ones too much.
  std::ranges::sort(full_scales);
  intensity_scale_ = 1.0F / full_scales[full_scales.size() - (full_scales.size() > 2 ? 2 : 1)];
  const auto known = source_ ? source_->sensor() : std::nullopt;
  // KITTI's own scans tell neither times nor rings.
  const bool is_as_kittis =
      ending_of(files_.front()) == ".bin" && typical.time_offset_s.empty() && typical.ring.empty();
  suggested_sensor_ = known ? *known : guess_sensor(typical, is_as_kittis);
  if (typical.time_offset_s.empty() && typical.ring.empty() &&
      suggested_sensor_.name == hdl_64e().name)
    kitti_lidar_ = find_kitti_lidar();
}

std::optional<KittiLidar> ScanDataset::find_kitti_lidar() const {
  std::vector<Scan> scans;
  for (const std::size_t i : sample()) {
    try {
      scans.push_back(read_unscaled(i).scan);
    } catch (const DatasetError&) {
      // Whoever reads that scan is told.
      continue;
    }
  }
  const bool is_kittis_own = ending_of(files_.front()) == ".bin";
  return recognise_kitti_lidar(scans, period_s(), !is_kittis_own);
}

double ScanDataset::period_s() const {
  std::vector<std::int64_t> steps_ns;
  for (std::size_t i = 1; i < size(); ++i) steps_ns.push_back(stamp_ns(i) - stamp_ns(i - 1));
  const double usual_s = 1e-9 * static_cast<double>(default_period_ns);
  if (steps_ns.empty()) return usual_s;
  const double median_s = 1e-9 * static_cast<double>(median_of(steps_ns));
  // Recordings may leave scans out.
  return median_s > 0.5 * usual_s && median_s < 1.5 * usual_s ? median_s : usual_s;
}

std::size_t ScanDataset::find_clouds_per_turn() const {
  constexpr std::size_t places = 5, max_clouds = 200;
  // Stamps that are made up do not tell how long a turn lasts.
  constexpr std::int64_t untimed_step_ns = 1'000'000;
  std::vector<std::size_t> found;
  for (std::size_t k = 0; k < places; ++k) {
    const std::size_t first = files_.size() * k / places;
    TurnRecognition recognition;
    const std::size_t end = std::min(files_.size(), first + max_clouds);
    for (std::size_t part = first; part < end && recognition.clouds_per_turn() == 0; ++part) {
      try {
        const Scan cloud = read_part(part).scan;
        const std::int64_t stamp_ns = times_unit_ == TimesUnit::none
                                          ? untimed_step_ns * static_cast<std::int64_t>(part)
                                          : cloud.stamp_ns;
        recognition.learn({.stamp_ns = stamp_ns, .arc = viewed_arc(cloud.points_lidar)});
      } catch (const DatasetError&) {
        // Whoever reads that scan is told.
        recognition = {};
      }
    }
    if (recognition.clouds_per_turn() > 0) found.push_back(recognition.clouds_per_turn());
  }
  if (found.empty()) return 1;
  const auto middle = found.begin() + static_cast<std::ptrdiff_t>(found.size() / 2);
  std::ranges::nth_element(found, middle);
  return *middle;
}

void ScanDataset::join_turns(std::size_t clouds_per_turn) {
  if (source_ && !source_->is_of_one_frame()) return;
  if (clouds_per_turn == TurnJoiner::automatic) clouds_per_turn = find_clouds_per_turn();
  if (clouds_per_turn == clouds_per_turn_) return;
  clouds_per_turn_ = clouds_per_turn;
  turns_.clear();
  if (times_unit_ == TimesUnit::none)
    stamps_ns_ = made_up_stamps(files_.size(),
                                default_period_ns / static_cast<std::int64_t>(clouds_per_turn));
  TurnCounter counter(clouds_per_turn);
  for (std::size_t part = 0; part < files_.size(); ++part)
    if (counter.begins_turn(stamps_ns_[part])) turns_.push_back(part);
  learn_from_sample();
}

fs::path ScanDataset::beside(std::size_t part, const char* folder, const char* extension) const {
  if (sequence_.empty()) return {};
  return sequence_ / folder / (files_.at(part).stem().string() + extension);
}

std::string ScanDataset::remark_on_times() const {
  const bool has_file = !sequence_.empty() && fs::exists(sequence_ / "times.txt");
  switch (times_unit_) {
    case TimesUnit::seconds:
      return {};
    case TimesUnit::milliseconds:
      return "the numbers in times.txt are taken for milliseconds";
    case TimesUnit::microseconds:
      return "the numbers in times.txt are taken for microseconds";
    case TimesUnit::nanoseconds:
      return "the numbers in times.txt are taken for nanoseconds";
    case TimesUnit::none:
      break;
  }
  if (size() < 2) return {};
  return (has_file ? "the times in times.txt do not grow from scan to scan"
                   : "the names of the files tell no time (" + files_.front().filename().string() +
                         ")") +
         std::string(
             ": ten scans a second are assumed, and samples of an IMU or a receiver beside "
             "them do not fit to that");
}

std::vector<std::string> ScanDataset::remarks(bool is_mount_known) const {
  std::vector<std::string> remarks;
  if (!format_.empty()) remarks.push_back("points have " + format_);
  if (const std::string remark = remark_on_times(); !remark.empty()) remarks.push_back(remark);
  if (clouds_per_turn_ > 1)
    remarks.push_back(std::to_string(clouds_per_turn_) +
                      " clouds after another are joined to a scan, as parts of a turn: " +
                      std::to_string(files_.size()) + " clouds, " + std::to_string(size()) +
                      " scans ('input: {clouds_per_turn: 1}' in a --config file leaves each a "
                      "scan)");
  if (are_axes_ours_)
    remarks.push_back(std::string(axes_file_name) +
                      " says that its points are x ahead, y left and z up already: the names of "
                      "these in 'fields' are not applied");
  if (is_too_large_)
    remarks.push_back(
        "half of the points lie more than 150 m away: coordinates are taken for "
        "metres in the lidar's frame, and these may be centimetres or millimetres, or in "
        "the frame of a map");
  for (std::string& remark : remarks_on_scans(*this, is_mount_known))
    remarks.push_back(std::move(remark));
  return remarks;
}

std::vector<fs::path> ScanDataset::all_files() const {
  std::vector<fs::path> files = files_;
  if (source_) return files;
  const auto add = [&files](const fs::path& file) {
    std::error_code error;
    if (!file.empty() && fs::is_regular_file(file, error)) files.push_back(file);
  };
  for (std::size_t part = 0; part < files_.size(); ++part) {
    add(beside(part, "labels", ".label"));
    for (const char* folder : {"time_offsets", "rings"}) add(beside(part, folder, ".bin"));
  }
  for (const char* part : sequence_parts)
    add((sequence_.empty() ? files_.front().parent_path() : sequence_) / part);
  return files;
}

bool ScanDataset::has_labels(std::size_t i) const {
  if (ending_of(file(i)) != ".bin") return !read(i).raw_labels.empty();
  for (std::size_t part = first_part(i); part < end_of_parts(i); ++part)
    if (!fs::exists(beside(part, "labels", ".label"))) return false;
  return true;
}

bool ScanDataset::lacks_labels() const {
  if (lacks_labels_ || sequence_.empty() || ending_of(file(0)) != ".bin") return lacks_labels_;
  for (std::size_t i = 0; i < size(); ++i)
    if (!has_labels(i)) return true;
  return false;
}

DatasetFrame ScanDataset::read_unscaled(std::size_t i) const {
  DatasetFrame frame = read_as_recorded(i);
  if (label_kind_ != LabelKind::classes) return frame;
  for (std::uint32_t& label : frame.raw_labels)
    label = semantic_kitti_id(class_of_label(label, LabelKind::classes));
  return frame;
}

DatasetFrame ScanDataset::read_as_recorded(std::size_t i) const {
  if (turns_.empty()) return read_part(i);
  DatasetFrame joined;
  std::vector<Scan> parts;
  std::vector<std::vector<std::uint32_t>> raw_labels;
  bool is_labelled = false;
  for (std::size_t part = first_part(i); part < end_of_parts(i); ++part) {
    DatasetFrame frame = read_part(part);
    is_labelled |= !frame.raw_labels.empty();
    frame.raw_labels.resize(frame.scan.size());
    raw_labels.push_back(std::move(frame.raw_labels));
    parts.push_back(std::move(frame.scan));
    joined.format = std::move(frame.format);
  }
  joined.scan = joined_turn(std::move(parts));
  if (!is_labelled) return joined;
  for (const auto& labels : raw_labels)
    joined.raw_labels.insert(joined.raw_labels.end(), labels.begin(), labels.end());
  return joined;
}

DatasetFrame ScanDataset::read_part(std::size_t part) const {
  if (source_) return source_->read(part);
  if (ending_of(files_.at(part)) != ".bin") {
    auto [scan, raw_labels, format] =
        read_point_cloud(files_.at(part), stamps_ns_.at(part), fields_);
    return {std::move(scan), std::move(raw_labels), std::move(format)};
  }
  DatasetFrame frame;
  frame.scan = read_bin(files_.at(part), bin_layout_);
  if (const Eigen::Matrix3f axes = axes_by(fields_); !axes.isIdentity(0.0F)) {
    for (Eigen::Vector3f& p : frame.scan.points_lidar) p = axes * p;
    frame.format = axes_in_words(fields_) + "intensity";
  }
  if (bin_layout_ == BinLayout::nuscenes)
    frame.format = axes_in_words(fields_) +
                   "intensity (0 to 255) and ring as nuScenes' files have them, no time";
  frame.scan.stamp_ns = stamps_ns_.at(part);
  const std::size_t points = frame.scan.size();
  if (const auto labels = beside(part, "labels", ".label"); fs::exists(labels)) {
    frame.raw_labels = read_kitti_labels(labels, points);
  }
  const auto side_file = [&]<class T>(const char* folder, std::vector<T>& values) {
    const fs::path side = beside(part, folder, ".bin");
    if (!fs::exists(side)) return;
    values = read_values<T>(side);
    if (values.size() == points) return;
    throw DatasetError(side, std::to_string(values.size()) + " values for a scan of " +
                                 std::to_string(points) + " points; remove the file");
  };
  side_file("time_offsets", frame.scan.time_offset_s);
  side_file("rings", frame.scan.ring);
  return frame;
}

DatasetFrame ScanDataset::read(std::size_t i) const {
  DatasetFrame frame = read_uncorrected(i);
  if (kitti_lidar_) kitti_lidar_->correct(frame.scan);
  return frame;
}

DatasetFrame ScanDataset::read_uncorrected(std::size_t i) const {
  DatasetFrame frame = read_unscaled(i);
  if (intensity_scale_ != 1.0F) {
    for (float& value : frame.scan.intensity) value *= intensity_scale_;
  }
  frame.scan.labels = reduced_classes(frame.raw_labels);
  return frame;
}

std::vector<ImuSample> ScanDataset::imu() const {
  if (source_) return source_->imu();
  const fs::path file = imu_file_in(sequence_.empty() ? files_.front().parent_path() : sequence_);
  return file.empty() ? std::vector<ImuSample>{} : read_imu_file(file);
}

std::vector<GnssFix> ScanDataset::gnss() const {
  if (source_) return source_->gnss();
  const fs::path file = (sequence_.empty() ? files_.front().parent_path() : sequence_) / "gnss.csv";
  return fs::exists(file) ? read_gnss_csv(file) : std::vector<GnssFix>{};
}

std::optional<Trajectory> ScanDataset::truth() const {
  if (sequence_.empty()) return std::nullopt;
  const fs::path lidar_file = sequence_ / "poses_lidar.txt";
  const fs::path camera_file = sequence_ / "poses.txt";
  const bool in_lidar_frame = fs::exists(lidar_file);
  if (!in_lidar_frame && !fs::exists(camera_file)) return std::nullopt;
  const fs::path& pose_file = in_lidar_frame ? lidar_file : camera_file;

  std::vector<Eigen::Isometry3d> T_map_lidar = read_poses(pose_file);
  if (!in_lidar_frame) {
    const fs::path calibration = sequence_ / "calib.txt";
    if (!fs::exists(calibration)) {
      throw CameraUnknownError(
          calibration,
          "no such file, and poses.txt is in the camera frame; add the sequence's "
          "calib.txt, or poses in the lidar frame as poses_lidar.txt");
    }
    T_map_lidar = lidar_poses_from_camera(T_map_lidar, read_kitti_calibration(calibration));
  }
  // The file's poses are of the axes that its points have there.
  const Eigen::Matrix3d axes = axes_by(fields_).cast<double>();
  if (are_axes(axes.cast<float>()))
    for (Eigen::Isometry3d& T : T_map_lidar) T = about_other_axes(T, axes);
  Trajectory trajectory;
  const auto lines = lines_in(pose_file, lines_, T_map_lidar.size(), files_);
  for (std::size_t i = 0; i < size(); ++i) {
    trajectory.push_back({stamp_ns(i), T_map_lidar[lines[first_part(i)]]});
  }
  return trajectory;
}

}  // namespace stillmap
