#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/lidar/point_fields.hpp"
#include "core/lidar/scan.hpp"
#include "core/lidar/semantic_class.hpp"

namespace stillmap {

/// A scan of a file with the labels it carries as they are there (empty without a label field).
struct CloudFile {
  Scan scan;
  std::vector<std::uint32_t> raw_labels;
  /// As DatasetFrame::format.
  std::string format;
};

/// Reads a PCD (ascii, binary, compressed) or PLY (ascii, binary) file by the names of its fields
/// (see PointFieldNames; "scalar_Intensity", as CloudCompare writes it, is "intensity"): x y z
/// (required), intensity, ring, time (in any unit: see point_times())
/// and label (original SemanticKITTI id, instance in the high bits). Other fields and padding are
/// skipped. Intensity stays as the file has it (0..255 from many). `stamp_ns` becomes the scan's
/// stamp. Throws DatasetError for anything that is not such a file.
[[nodiscard]] CloudFile read_point_cloud(const std::filesystem::path& file, std::int64_t stamp_ns,
                                         const PointFieldNames& names = {});

/// One point of a map to be written.
struct ColouredPoint {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();
  SemanticClass label = SemanticClass::unlabeled;
  /// Probability of the label, 0..1.
  float confidence = 0.0F;
};

/// Writes binary PCD or PLY: x y z, the class's colour (PCD: packed `rgb`, PLY: red green blue),
/// `label` (SemanticKITTI's original id, uint32) and `confidence`. A file that is there stays until
/// the new one is whole. Throws DatasetWriteError.
void write_pcd(const std::filesystem::path& file, std::span<const ColouredPoint> points);
void write_ply(const std::filesystem::path& file, std::span<const ColouredPoint> points);

}  // namespace stillmap
