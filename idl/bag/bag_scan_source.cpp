#include "idl/bag/bag_scan_source.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

#include "core/dataset/dataset_error.hpp"
#include "idl/bag/cdr_reader.hpp"

namespace stillmap::dds {
namespace {

namespace fs = std::filesystem;

/// Encapsulation, sec, nanosec, and a frame's name of usual length.
constexpr int header_bytes = 128;

std::string listed(const std::vector<BagTopic>& topics) {
  std::string text;
  for (const BagTopic& topic : topics) {
    text.append("\n  ").append(topic.name).append("  ").append(topic.type).append("  ");
    text.append(std::to_string(topic.messages)).append(" messages");
  }
  return text.empty() ? " none" : text;
}

bool has_scans(const BagTopic& topic) {
  return topic.messages > 0 && scan_message_type(topic.type).has_value();
}

BagTopic only_topic(const fs::path& path, const std::vector<BagTopic>& topics) {
  std::vector<BagTopic> of_scans;
  std::ranges::copy_if(topics, std::back_inserter(of_scans), has_scans);
  if (of_scans.size() == 1) return of_scans.front();
  if (of_scans.empty()) {
    throw DatasetError(path,
                       "has no topic of scans (sensor_msgs/msg/PointCloud2, "
                       "velodyne_msgs/msg/VelodyneScan or Livox's CustomMsg) with messages; "
                       "its topics are:" +
                           listed(topics));
  }
  throw DatasetError(path,
                     "has several topics of scans; choose one with --topic-in:" + listed(of_scans));
}

BagTopic named_topic(const fs::path& path, const std::vector<BagTopic>& topics,
                     const std::string& topic) {
  const std::string name = topic.starts_with('/') ? topic : "/" + topic;
  const auto found = std::ranges::find_if(
      topics, [&](const BagTopic& other) { return other.name == name || other.name == topic; });
  if (found == topics.end()) {
    throw DatasetError(path, "has no topic " + name + "; its topics are:" + listed(topics));
  }
  if (!has_scans(*found)) {
    throw DatasetError(path,
                       "topic " + name + " has no scans to read; its topics are:" + listed(topics));
  }
  return *found;
}

}  // namespace

BagScanSource::BagScanSource(const fs::path& path, const std::string& topic, LabelKind label_kind,
                             PointFieldNames fields)
    : bag_(path),
      topic_(topic.empty() ? only_topic(path, bag_.topics())
                           : named_topic(path, bag_.topics(), topic)),
      kind_(*scan_message_type(topic_.type)),
      label_kind_(label_kind),
      fields_(std::move(fields)),
      messages_(bag_.messages(topic_.name)) {
  if (topic_.serialization_format != "cdr") {
    throw DatasetError(path, "topic " + topic_.name + " is serialized as '" +
                                 topic_.serialization_format + "'; only cdr is read");
  }
  if (messages_.empty()) {
    throw DatasetError(path, "the messages of topic " + topic_.name +
                                 " cannot be found by its name: the bag is damaged");
  }
  bool stamped = false;
  for (std::size_t i = 0; i < messages_.size(); ++i) {
    std::optional<std::int64_t> stamp_ns;
    try {
      const auto header = bag_.first_bytes(messages_[i], header_bytes);
      stamp_ns = header_stamp_ns(header);
      if (const auto frame = header_frame(header)) ++frames_[*frame];
    } catch (const CdrError&) {
      // Read again, and reported then, when its turn comes.
    } catch (const DatasetError&) {
      // The same: a page of the file is damaged there.
    }
    stamped = stamped || stamp_ns.value_or(0) != 0;
    stamps_ns_.push_back(stamp_ns.value_or(messages_[i].received_ns));
  }
  if (!stamped) {
    std::ranges::transform(messages_, stamps_ns_.begin(), &BagMessage::received_ns);
  }
  sensor_ = sensor_of_first_readable();
}

std::optional<SensorModel> BagScanSource::sensor_of_first_readable() const {
  constexpr std::size_t max_tries = 9;
  for (std::size_t i = 0; i < std::min(messages_.size(), max_tries); ++i) {
    try {
      return read_message(i).sensor;
    } catch (const DatasetError&) {
      // Whoever reads that scan is told.
    }
  }
  return std::nullopt;
}

fs::path BagScanSource::name(std::size_t i) const {
  return bag_.file_name(messages_.at(i).file) / fs::path(topic_.name).relative_path() /
         std::to_string(i);
}

DecodedScan BagScanSource::read_message(std::size_t i) const {
  try {
    return decode_scan(kind_, bag_.bytes(messages_.at(i)), label_kind_, fields_);
  } catch (const CdrError& fault) {
    throw DatasetError(name(i), "message " + std::to_string(messages_[i].row) + " of " +
                                    topic_.name + " (" + topic_.type +
                                    ") cannot be used: " + fault.what());
  }
}

DatasetFrame BagScanSource::read(std::size_t i) const {
  DatasetFrame frame = read_message(i).frame;
  frame.scan.stamp_ns = stamp_ns(i);
  return frame;
}

std::vector<BagTopic> BagScanSource::topics_of(std::string_view type) const {
  std::vector<BagTopic> found;
  std::ranges::copy_if(bag_.topics(), std::back_inserter(found), [type](const BagTopic& topic) {
    return topic.messages > 0 && topic.type == type && topic.serialization_format == "cdr";
  });
  return found;
}

std::vector<BagMessage> BagScanSource::only_messages_of(std::string_view type) const {
  const std::vector<BagTopic> topics = topics_of(type);
  if (topics.size() != 1) return {};
  return bag_.messages(topics.front().name);
}

std::vector<std::string> BagScanSource::faults() const {
  std::vector<std::string> faults = bag_.faults();
  if (frames_.size() > 1) {
    std::string frames;
    for (const auto& [frame, scans] : frames_) {
      frames += (frames.empty() ? "'" : ", '") + frame + "' (" + std::to_string(scans) + ")";
    }
    faults.push_back("the scans of topic " + topic_.name + " are of several frames: " + frames +
                     "; they are taken for one lidar's. Scans of several lidars must lie on a "
                     "topic each");
  }
  for (const std::string_view type : {imu_message_type, gnss_message_type}) {
    const std::vector<BagTopic> topics = topics_of(type);
    if (topics.size() < 2) continue;
    faults.push_back("the bag has several topics of " + std::string(type) +
                     ", so none of them is used; leave one in it:" + listed(topics));
  }
  return faults;
}

std::vector<ImuSample> BagScanSource::imu() const {
  std::vector<ImuSample> samples;
  for (const BagMessage& message : only_messages_of(imu_message_type)) {
    try {
      samples.push_back(decode_imu(bag_.bytes(message)));
    } catch (const CdrError&) {
      // One of hundreds a second; the mapper sees the gap.
    } catch (const DatasetError&) {
      // A damaged page of the file: the same.
    }
  }
  return samples;
}

std::vector<GnssFix> BagScanSource::gnss() const {
  std::vector<GnssFix> fixes;
  for (const BagMessage& message : only_messages_of(gnss_message_type)) {
    try {
      if (const auto fix = decode_gnss(bag_.bytes(message))) fixes.push_back(*fix);
    } catch (const CdrError&) {
      // Others say where the robot was.
    } catch (const DatasetError&) {
      // A damaged page of the file: the same.
    }
  }
  return fixes;
}

Recording open_recording(const fs::path& path, const std::string& topic,
                         std::optional<LabelKind> label_kind, const PointFieldNames& fields) {
  if (is_bag(path)) {
    const auto bag = std::make_shared<const BagScanSource>(
        path, topic, label_kind.value_or(LabelKind::semantic_kitti), fields);
    return {ScanDataset(bag, label_kind), bag->faults(), bag->lost_parts()};
  }
  if (!topic.empty()) {
    throw DatasetError(path, "is no bag, and only bags have topics: leave --topic-in out");
  }
  return {ScanDataset(path, label_kind, fields), {}, {}};
}

ScanDataset open_sequence(const fs::path& path, const std::string& topic) {
  return open_recording(path, topic).dataset;
}

}  // namespace stillmap::dds
