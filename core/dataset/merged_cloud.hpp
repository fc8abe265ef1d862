#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "core/dataset/cloud_content.hpp"

namespace stillmap {

/// A point of many scans in one cloud, which knows where it came from.
struct MergedPoint {
  /// Map frame, relative to the cloud's origin [m].
  Eigen::Vector3f position = Eigen::Vector3f::Zero();
  float intensity = 0.0F;
  /// As in a .label file: class in the low, instance in the high 16 bits.
  std::uint32_t raw_label = 0;
  /// Number in the name of the scan's file.
  std::uint32_t scan = 0;
  /// Index in the scan.
  std::uint32_t point = 0;
};

/// Writes merged points as a binary PLY: x y z intensity (float), red green blue (of the class),
/// label, instance, scan_index, point_index (uint). Class and instance have a field each, so that
/// an editor that keeps its fields as floats does not round them. The origin stands in a comment.
/// The file appears under its name when it is complete.
class MergedCloudWriter {
 public:
  /// Throws DatasetError when the file exists and `replace` is not set, or cannot be made.
  MergedCloudWriter(const std::filesystem::path& file, const Eigen::Vector3d& origin_map,
                    bool replace);
  /// Without finish(): leaves nothing behind.
  ~MergedCloudWriter();
  MergedCloudWriter(const MergedCloudWriter&) = delete;
  MergedCloudWriter& operator=(const MergedCloudWriter&) = delete;

  /// Throws DatasetError.
  void add(const MergedPoint& point);
  /// Throws DatasetError.
  void finish();

  [[nodiscard]] std::uint64_t points() const { return points_; }
  [[nodiscard]] const std::filesystem::path& file() const { return file_; }

 private:
  void flush();

  std::filesystem::path file_;
  std::filesystem::path unfinished_file_;
  Eigen::Vector3d origin_map_;
  std::uint64_t points_ = 0;
  std::string buffer_;
};

/// What an editor left of a merged point.
struct EditedPoint {
  std::uint32_t scan = 0;
  std::uint32_t point = 0;
  /// Class, or class and instance as in a .label file.
  std::uint32_t label = 0;
  /// Nothing when the editor dropped the field.
  std::optional<std::uint32_t> instance;
};

/// Reads the labels of a merged cloud after editing: points in any order and number, fields in any
/// order and of any number type, ascii or binary of either byte order. Fields are known by their
/// names (label, instance, scan_index, point_index; also with "scalar_" before them, as
/// CloudCompare writes), whatever their case; others are passed over.
class MergedCloudReader {
 public:
  /// Throws DatasetError when the file is no such PLY, lacks a field, or is truncated.
  explicit MergedCloudReader(const std::filesystem::path& file);

  [[nodiscard]] std::uint64_t size() const { return header_.points(); }

  /// The next of size() points. Throws DatasetError when it holds no such numbers.
  [[nodiscard]] EditedPoint next();

 private:
  struct Column {
    std::size_t field = 0;
    std::size_t offset = 0;
  };

  [[nodiscard]] std::optional<Column> find(const std::string& name) const;
  [[nodiscard]] Column required(const std::string& name) const;
  void read_words();
  [[nodiscard]] double value(const Column& column) const;
  [[nodiscard]] std::uint32_t whole(const Column& column, double largest) const;

  std::filesystem::path file_;
  std::ifstream in_;
  CloudContent header_;
  Column label_, scan_, point_;
  std::optional<Column> instance_;
  std::uint64_t next_ = 0;
  /// The current point: as it is in a binary file, or in numbers from a text.
  std::vector<char> row_;
  std::vector<double> numbers_;
};

}  // namespace stillmap
