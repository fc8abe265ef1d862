#include "core/dataset/merged_cloud.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <limits>
#include <sstream>
#include <system_error>

#include "core/dataset/dataset_error.hpp"
#include "core/lidar/semantic_class.hpp"

namespace stillmap {
namespace {

/// Enough points at a time that a write costs little, few enough for hundreds of open clouds.
constexpr std::size_t buffer_bytes = std::size_t{1} << 18U;
/// The header is written with the count once that is known; remarks fill it up to this length.
constexpr std::size_t header_bytes = 1024;

template <class T>
void append(std::string& buffer, const T& value) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  buffer.append(bytes, sizeof value);
}

std::string header(std::uint64_t points, const Eigen::Vector3d& origin_map) {
  std::ostringstream out;
  out.precision(12);
  out << "ply\nformat binary_little_endian 1.0\n"
         "comment stillmap merged scans; map frame = lidar frame of the sequence's first pose\n"
         "comment origin_map_m "
      << origin_map.x() << ' ' << origin_map.y() << ' ' << origin_map.z()
      << "\ncomment x y z are metres from that origin; label and instance are SemanticKITTI's\n"
         "comment keep scan_index and point_index: they lead the labels back to the scans\n"
         "element vertex "
      << points
      << "\nproperty float x\nproperty float y\nproperty float z\nproperty float intensity\n"
         "property uchar red\nproperty uchar green\nproperty uchar blue\n"
         "property uint label\nproperty uint instance\n"
         "property uint scan_index\nproperty uint point_index\n";
  const std::string text = out.str();
  const std::string remark = "comment ";
  const std::string end = "\nend_header\n";
  return text + remark + std::string(header_bytes - text.size() - remark.size() - end.size(), '.') +
         end;
}

std::string lower(std::string text) {
  std::ranges::transform(text, text.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

/// The name that we gave the field.
std::string own_name(const std::string& field) {
  const std::string text = lower(field);
  constexpr std::string_view prefix = "scalar_";
  return text.starts_with(prefix) ? text.substr(prefix.size()) : text;
}

void check_size(const std::filesystem::path& file, const CloudContent& header,
                std::uint64_t bytes_left) {
  const std::uint64_t point_bytes =
      header.encoding == "ascii" ? 2 * header.fields.size() : header.point_bytes();
  if (header.point_bytes() > max_point_bytes) {
    throw DatasetError(file, "has points of " + std::to_string(header.point_bytes()) +
                                 " bytes; the header is damaged");
  }
  // The last number of a text may lack its line's end.
  if (header.points() * point_bytes > bytes_left + 1) {
    throw DatasetError(file, "is truncated: the header announces " +
                                 std::to_string(header.points()) + " points and " +
                                 std::to_string(bytes_left) + " bytes follow; save it again");
  }
}

}  // namespace

MergedCloudWriter::MergedCloudWriter(const std::filesystem::path& file,
                                     const Eigen::Vector3d& origin_map, bool replace)
    : file_(file), unfinished_file_(file.string() + ".part"), origin_map_(origin_map) {
  if (!replace && std::filesystem::exists(file)) {
    throw DatasetError(file, "is there already; name another file, or replace it with --force");
  }
  std::ofstream out(unfinished_file_, std::ios::binary | std::ios::trunc);
  out << header(0, origin_map);
  out.close();
  if (!out) throw DatasetWriteError(unfinished_file_, "cannot be written; check the folder");
}

MergedCloudWriter::~MergedCloudWriter() {
  std::error_code ignored;
  std::filesystem::remove(unfinished_file_, ignored);
}

void MergedCloudWriter::add(const MergedPoint& point) {
  const Rgb rgb =
      colour(class_from_semantic_kitti(static_cast<std::uint16_t>(point.raw_label & 0xFFFFU)));
  append(buffer_, point.position.x());
  append(buffer_, point.position.y());
  append(buffer_, point.position.z());
  append(buffer_, point.intensity);
  append(buffer_, rgb.r);
  append(buffer_, rgb.g);
  append(buffer_, rgb.b);
  append(buffer_, std::uint32_t{point.raw_label & 0xFFFFU});
  append(buffer_, std::uint32_t{point.raw_label >> 16U});
  append(buffer_, point.scan);
  append(buffer_, point.point);
  ++points_;
  if (buffer_.size() >= buffer_bytes) flush();
}

void MergedCloudWriter::flush() {
  // Reopened for each write: a long sequence has more tiles than a process may have open files.
  std::ofstream out(unfinished_file_, std::ios::binary | std::ios::app);
  out << buffer_;
  out.close();
  if (!out) throw DatasetWriteError(unfinished_file_, "cannot be written; check the space left");
  buffer_.clear();
}

void MergedCloudWriter::finish() {
  flush();
  std::fstream out(unfinished_file_, std::ios::binary | std::ios::in | std::ios::out);
  out << header(points_, origin_map_);
  out.close();
  std::error_code error;
  if (out) std::filesystem::rename(unfinished_file_, file_, error);
  if (!out || error) throw DatasetWriteError(file_, "cannot be written; check the folder");
}

MergedCloudReader::MergedCloudReader(const std::filesystem::path& file)
    : file_(file), in_(file, std::ios::binary) {
  std::error_code error;
  const std::uint64_t file_bytes = std::filesystem::file_size(file, error);
  if (error || !in_) throw DatasetError(file, "no such file, or it cannot be read");
  header_ = read_ply_header(file, in_);
  if (header_.encoding != "ascii" && !header_.encoding.starts_with("binary_")) {
    throw DatasetError(file, "format \"" + header_.encoding.substr(0, 40) + "\" is not PLY's");
  }
  check_size(file, header_, file_bytes - static_cast<std::uint64_t>(in_.tellg()));
  label_ = required("label");
  scan_ = required("scan_index");
  point_ = required("point_index");
  instance_ = find("instance");
  row_.resize(header_.point_bytes());
  numbers_.resize(header_.fields.size());
}

std::optional<MergedCloudReader::Column> MergedCloudReader::find(const std::string& name) const {
  Column column;
  for (const CloudField& field : header_.fields) {
    if (own_name(field.name) == name) return column;
    ++column.field;
    column.offset += field.bytes;
  }
  return std::nullopt;
}

MergedCloudReader::Column MergedCloudReader::required(const std::string& name) const {
  if (const auto column = find(name)) return *column;
  std::string present;
  for (const CloudField& field : header_.fields) present.append(" ").append(field.name, 0, 40);
  throw DatasetError(file_, "has no field \"" + name + "\", only:" + present +
                                ". Take a cloud from 'stillmap dataset aggregate', and have the "
                                "editor keep all its scalar fields");
}

EditedPoint MergedCloudReader::next() {
  if (header_.encoding == "ascii") {
    read_words();
  } else if (!in_.read(row_.data(), static_cast<std::streamsize>(row_.size()))) {
    throw DatasetError(file_, "ends before point " + std::to_string(next_));
  }
  constexpr double largest_half = std::numeric_limits<std::uint16_t>::max();
  constexpr double largest_index = std::numeric_limits<std::uint32_t>::max();
  EditedPoint edited{.scan = whole(scan_, largest_index),
                     .point = whole(point_, largest_index),
                     .label = whole(label_, instance_ ? largest_half : largest_index),
                     .instance = {}};
  if (instance_) edited.instance = whole(*instance_, largest_half);
  ++next_;
  return edited;
}

void MergedCloudReader::read_words() {
  std::string word;
  for (double& number : numbers_) {
    in_ >> word;
    const auto value = in_ ? number_of(word) : std::nullopt;
    if (!value) {
      throw DatasetError(file_, "point " + std::to_string(next_) + ": \"" + word.substr(0, 40) +
                                    "\" is not a number; the file is damaged");
    }
    number = *value;
  }
}

double MergedCloudReader::value(const Column& column) const {
  if (header_.encoding == "ascii") return numbers_[column.field];
  return field_value(header_.fields[column.field], row_.data() + column.offset,
                     header_.encoding == "binary_big_endian");
}

std::uint32_t MergedCloudReader::whole(const Column& column, double largest) const {
  const CloudField& field = header_.fields[column.field];
  // A float counts in ones only up to here; beyond, the number may have been rounded.
  constexpr double exact_in_float = 16'777'216.0;
  const double limit =
      field.kind == 'F' && field.bytes == 4 ? std::min(largest, exact_in_float) : largest;
  const double number = value(column);
  if (number >= 0.0 && number <= limit && std::floor(number) == number) {
    return static_cast<std::uint32_t>(number);
  }
  throw DatasetError(file_, "point " + std::to_string(next_) + ": " + field.name.substr(0, 40) +
                                " is " + std::to_string(number) +
                                ", not a whole number from 0 to " +
                                std::to_string(static_cast<std::uint64_t>(limit)));
}

}  // namespace stillmap
