#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/dataset/scan_dataset.hpp"
#include "core/dataset/scan_source.hpp"
#include "idl/bag/bag.hpp"
#include "idl/bag/scan_messages.hpp"

namespace stillmap::dds {

/// The scans of one topic of a bag: PointCloud2, or the packets of a Velodyne, or Livox's own
/// points. Stamps are those of the messages' headers; where they have none, the times of reception.
class BagScanSource final : public ScanSource {
 public:
  /// `topic` may be empty when the bag has only one topic of scans, and go without its slash.
  /// Throws DatasetError, which lists the topics.
  BagScanSource(const std::filesystem::path& path, const std::string& topic,
                LabelKind label_kind = LabelKind::semantic_kitti, PointFieldNames fields = {});

  [[nodiscard]] const BagTopic& topic() const { return topic_; }
  [[nodiscard]] std::size_t size() const override { return messages_.size(); }
  [[nodiscard]] std::filesystem::path name(std::size_t i) const override;
  [[nodiscard]] std::int64_t stamp_ns(std::size_t i) const override { return stamps_ns_.at(i); }
  [[nodiscard]] DatasetFrame read(std::size_t i) const override;
  [[nodiscard]] std::optional<SensorModel> sensor() const override { return sensor_; }
  [[nodiscard]] bool is_of_one_frame() const override { return frames_.size() < 2; }
  /// Of the bag's only topic of sensor_msgs/msg/Imu; nothing where there are several. Messages that
  /// are damaged are left out.
  [[nodiscard]] std::vector<ImuSample> imu() const override;
  /// Likewise of sensor_msgs/msg/NavSatFix.
  [[nodiscard]] std::vector<GnssFix> gnss() const override;
  /// What of the bag's files cannot be read at all, which topics are not used as there are several
  /// of an IMU or a receiver, and whether the scans are of several lidars, in words.
  [[nodiscard]] std::vector<std::string> faults() const;
  /// Of these: files of the bag that are missing, damaged, or not read.
  [[nodiscard]] std::vector<std::string> lost_parts() const { return bag_.faults(); }

 private:
  /// A damaged message says nothing.
  [[nodiscard]] std::optional<SensorModel> sensor_of_first_readable() const;
  [[nodiscard]] DecodedScan read_message(std::size_t i) const;
  /// Those of this type with messages.
  [[nodiscard]] std::vector<BagTopic> topics_of(std::string_view type) const;
  /// Of the only topic of this type; none where there are several.
  [[nodiscard]] std::vector<BagMessage> only_messages_of(std::string_view type) const;

  Bag bag_;
  BagTopic topic_;
  ScanMessageType kind_;
  LabelKind label_kind_;
  PointFieldNames fields_;
  std::vector<BagMessage> messages_;
  std::vector<std::int64_t> stamps_ns_;
  /// Numbers of scans by the frame in their headers.
  std::map<std::string, std::size_t> frames_;
  std::optional<SensorModel> sensor_;
};

/// A recording, and what of it is not read, in words.
struct Recording {
  ScanDataset dataset;
  std::vector<std::string> faults;
  /// Of these: parts that are missing, damaged, or left out.
  std::vector<std::string> lost_parts;
};

/// A recording of whatever kind: a bag, or what ScanDataset reads. `topic` is for bags alone.
/// `label_kind`: see ScanDataset. `fields`: the names of what clouds and files have of a point.
/// Throws DatasetError.
[[nodiscard]] Recording open_recording(const std::filesystem::path& path,
                                       const std::string& topic = {},
                                       std::optional<LabelKind> label_kind = {},
                                       const PointFieldNames& fields = {});
/// The same without its faults.
[[nodiscard]] ScanDataset open_sequence(const std::filesystem::path& path,
                                        const std::string& topic = {});

}  // namespace stillmap::dds
