#include "core/graph/scan_log.hpp"

#include <zstd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <span>
#include <utility>

#include "core/dataset/dataset_error.hpp"

namespace stillmap {
namespace {

constexpr float min_step_m = 0.004F;
constexpr std::uint64_t magic = 0x32474f4c4e414353;  // "SCANLOG2"
/// Larger ones are damage.
constexpr std::uint64_t max_points = 100'000'000;

/// What stands before a scan's compressed points.
struct Header {
  std::uint64_t magic_number = magic;
  std::uint64_t index = 0;
  std::int64_t stamp_ns = 0;
  /// Row by row, 3x4.
  std::array<double, 12> pose{};
  std::uint64_t points = 0;
  std::uint64_t packed_bytes = 0;
  std::uint32_t entry = 0;
  std::uint32_t flags = 0;
  double step_m = 0.0;
};

/// Of Header::flags.
constexpr std::uint32_t has_labels = 1;
constexpr std::uint32_t begins_elsewhere = 2;

/// Planes of bytes, one after the other: low and high bytes of the differences of x, y and z from
/// point to point, classes, confidence, motion.
constexpr std::size_t planes = 9;

constexpr float max_steps = 32767.0F;

/// By the numbers that stand in the file.
constexpr std::array entries{MapEntry::stays_out_with_waiting, MapEntry::enters,
                             MapEntry::enters_with_waiting, MapEntry::waits, MapEntry::stays_out};

bool has_points(MapEntry entry) {
  return entry != MapEntry::stays_out && entry != MapEntry::stays_out_with_waiting;
}

/// What is farther than all steps along an axis is nearer on its ray: seen through as far as it
/// matters, and in no other direction.
Eigen::Vector3f in_steps(const Eigen::Vector3f& point_m, float step_m) {
  const Eigen::Vector3f steps = point_m / step_m;
  return steps * std::min(1.0F, max_steps / std::max(steps.cwiseAbs().maxCoeff(), 1.0F));
}

std::vector<std::uint8_t> to_planes(const LabelledScan& labelled, float step_m) {
  const std::size_t count = labelled.scan.size();
  std::vector<std::uint8_t> bytes(planes * count);
  std::vector<Eigen::Vector3f> steps(count);
  std::ranges::transform(labelled.scan.points_lidar, steps.begin(),
                         [&](const Eigen::Vector3f& p) { return in_steps(p, step_m); });
  for (int axis = 0; axis < 3; ++axis) {
    std::uint16_t last = 0;
    const std::size_t low = 2 * static_cast<std::size_t>(axis) * count;
    for (std::size_t i = 0; i < count; ++i) {
      const auto value = static_cast<std::uint16_t>(std::lround(steps[i][axis]));
      const auto difference = static_cast<std::uint16_t>(value - std::exchange(last, value));
      bytes[low + i] = static_cast<std::uint8_t>(difference & 0xFFU);
      bytes[low + count + i] = static_cast<std::uint8_t>(difference >> 8U);
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    bytes[6 * count + i] = static_cast<std::uint8_t>(labelled.label(i));
    if (!labelled.labels.confidence.empty()) {
      const float confidence = std::clamp(labelled.labels.confidence[i], 0.0F, 1.0F);
      bytes[7 * count + i] = static_cast<std::uint8_t>(std::lround(255.0F * confidence));
    }
    bytes[8 * count + i] = static_cast<std::uint8_t>(labelled.motion[i]);
  }
  return bytes;
}

LabelledScan from_planes(std::span<const std::uint8_t> bytes, const Header& header) {
  const std::size_t count = header.points;
  const auto step_m = static_cast<float>(header.step_m);
  LabelledScan labelled;
  labelled.scan.stamp_ns = header.stamp_ns;
  labelled.scan.points_lidar.resize(count);
  labelled.motion.resize(count);
  for (int axis = 0; axis < 3; ++axis) {
    std::uint16_t last = 0;
    const std::size_t low = 2 * static_cast<std::size_t>(axis) * count;
    for (std::size_t i = 0; i < count; ++i) {
      last = static_cast<std::uint16_t>(last + bytes[low + i] + (bytes[low + count + i] << 8));
      labelled.scan.points_lidar[i][axis] = step_m * static_cast<std::int16_t>(last);
    }
  }
  for (std::size_t i = 0; i < count; ++i)
    labelled.motion[i] = static_cast<Motion>(bytes[8 * count + i]);
  if ((header.flags & has_labels) == 0U) return labelled;
  for (std::size_t i = 0; i < count; ++i) {
    labelled.labels.classes.push_back(static_cast<SemanticClass>(bytes[6 * count + i]));
    labelled.labels.confidence.push_back(static_cast<float>(bytes[7 * count + i]) / 255.0F);
  }
  return labelled;
}

/// With a checksum: planes of noise would decompress to other noise.
std::vector<std::uint8_t> compressed(std::span<const std::uint8_t> bytes,
                                     const std::filesystem::path& file) {
  const std::unique_ptr<ZSTD_CCtx, std::size_t (*)(ZSTD_CCtx*)> context(ZSTD_createCCtx(),
                                                                        ZSTD_freeCCtx);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, 1);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_checksumFlag, 1);
  std::vector<std::uint8_t> packed(ZSTD_compressBound(bytes.size()) + sizeof(std::uint32_t));
  const std::size_t size =
      ZSTD_compress2(context.get(), packed.data(), packed.size(), bytes.data(), bytes.size());
  if (ZSTD_isError(size) != 0U) throw DatasetError(file, ZSTD_getErrorName(size));
  packed.resize(size);
  return packed;
}

Header header_of(const LoggedScan& scan) {
  Header header;
  header.index = scan.index;
  header.stamp_ns = scan.labelled.scan.stamp_ns;
  Eigen::Map<Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(header.pose.data()) =
      scan.T_odom_lidar.matrix().topRows<3>();
  header.points = has_points(scan.entry) ? scan.labelled.scan.size() : 0;
  header.entry =
      static_cast<std::uint32_t>(std::ranges::find(entries, scan.entry) - entries.begin());
  header.flags = (scan.labelled.labels.empty() ? 0U : has_labels) |
                 (scan.begins_elsewhere ? begins_elsewhere : 0U);
  return header;
}

bool read_header(std::istream& in, Header& header) {
  in.read(reinterpret_cast<char*>(&header), sizeof(header));
  return in && header.magic_number == magic && header.points <= max_points &&
         header.entry < entries.size() && std::isfinite(header.step_m) &&
         header.packed_bytes <= ZSTD_compressBound(planes * header.points) + sizeof(std::uint32_t);
}

}  // namespace

ScanLog::ScanLog(std::filesystem::path file, double reach_m)
    : file_(std::move(file)),
      step_m_(std::max(min_step_m, static_cast<float>(reach_m) / max_steps)) {
  if (!std::filesystem::exists(file_)) std::ofstream(file_, std::ios::binary);
  stream_.open(file_, std::ios::in | std::ios::out | std::ios::binary);
  if (!stream_) throw DatasetError(file_, "cannot be opened; check the folder and its rights");
  scan_records();
}

void ScanLog::scan_records() {
  const std::uintmax_t size = std::filesystem::file_size(file_);
  stream_.clear();
  while (end_ + sizeof(Header) <= size) {
    Header header;
    stream_.seekg(static_cast<std::streamoff>(end_));
    if (!read_header(stream_, header)) break;
    const std::uintmax_t next = end_ + sizeof(Header) + header.packed_bytes;
    if (next > size) break;
    records_.push_back({header.index, end_});
    end_ = next;
  }
  stream_.clear();
}

void ScanLog::append(const LoggedScan& scan) {
  Header header = header_of(scan);
  header.step_m = static_cast<double>(step_m_);
  std::vector<std::uint8_t> packed;
  if (header.points > 0) packed = compressed(to_planes(scan.labelled, step_m_), file_);
  header.packed_bytes = packed.size();
  stream_.seekp(static_cast<std::streamoff>(end_));
  stream_.write(reinterpret_cast<const char*>(&header), sizeof(header));
  stream_.write(reinterpret_cast<const char*>(packed.data()),
                static_cast<std::streamsize>(packed.size()));
  if (!stream_) throw DatasetWriteError(file_, "cannot be written; check the space left");
  records_.push_back({header.index, end_});
  end_ += sizeof(header) + packed.size();
}

void ScanLog::flush() {
  stream_.flush();
  if (!stream_) throw DatasetWriteError(file_, "cannot be written; check the space left");
}

LoggedScan ScanLog::at(std::size_t place) {
  flush();
  Header header;
  stream_.seekg(static_cast<std::streamoff>(records_.at(place).offset));
  if (!read_header(stream_, header)) throw DatasetError(file_, "is damaged");
  std::vector<std::uint8_t> packed(header.packed_bytes);
  stream_.read(reinterpret_cast<char*>(packed.data()), static_cast<std::streamsize>(packed.size()));
  std::vector<std::uint8_t> bytes(planes * header.points);
  const std::size_t size =
      bytes.empty() ? 0 : ZSTD_decompress(bytes.data(), bytes.size(), packed.data(), packed.size());
  if (!stream_ || size != bytes.size()) throw DatasetError(file_, "is damaged");
  LoggedScan scan{.index = header.index,
                  .T_odom_lidar = Eigen::Isometry3d::Identity(),
                  .entry = entries[header.entry],
                  .begins_elsewhere = (header.flags & begins_elsewhere) != 0U,
                  .labelled = from_planes(bytes, header)};
  scan.T_odom_lidar.matrix().topRows<3>() =
      Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(header.pose.data());
  return scan;
}

void ScanLog::read(const std::function<void(LoggedScan)>& take) {
  for (std::size_t place = 0; place < records_.size(); ++place) take(at(place));
}

void ScanLog::truncate_from(std::uint64_t index) {
  while (!records_.empty() && records_.back().index >= index) {
    end_ = records_.back().offset;
    records_.pop_back();
  }
  flush();
  std::error_code error;
  std::filesystem::resize_file(file_, end_, error);
  if (error) throw DatasetError(file_, "cannot be shortened: " + error.message());
}

}  // namespace stillmap
