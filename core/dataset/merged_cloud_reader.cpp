#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <system_error>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/merged_cloud.hpp"

namespace stillmap {
namespace {

constexpr std::uint64_t max_point_bytes = 4096;

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
