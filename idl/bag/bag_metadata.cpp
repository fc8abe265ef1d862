#include "idl/bag/bag_metadata.hpp"

#include <yaml-cpp/yaml.h>

#include <fstream>

#include "core/dataset/dataset_error.hpp"

namespace stillmap::dds {
namespace {

namespace fs = std::filesystem;

constexpr int written_version = 5;

BagCompression compression_of(const fs::path& file, const YAML::Node& bag) {
  const auto mode = bag["compression_mode"].as<std::string>("");
  const auto format = bag["compression_format"].as<std::string>("");
  if (format.empty() || mode.empty() || mode == "NONE" || mode == "none") {
    return BagCompression::none;
  }
  if (format != "zstd") {
    throw DatasetError(
        file, "compression_format is '" + format + "'; only zstd is read: " + conversion_hint());
  }
  if (mode == "FILE" || mode == "file") return BagCompression::of_files;
  if (mode == "MESSAGE" || mode == "message") return BagCompression::of_messages;
  throw DatasetError(file, "compression_mode is '" + mode + "'; FILE and MESSAGE are read");
}

BagMetadata metadata_of(const fs::path& file, const YAML::Node& document) {
  const YAML::Node bag = document["rosbag2_bagfile_information"];
  if (!bag.IsMap()) throw DatasetError(file, "has no rosbag2_bagfile_information: is it a bag's?");
  const auto storage = bag["storage_identifier"].as<std::string>("");
  if (storage != "sqlite3" && storage != "mcap") {
    throw DatasetError(file, "storage_identifier is '" + storage +
                                 "'; sqlite3 and mcap are read: " + conversion_hint());
  }
  BagMetadata metadata;
  metadata.storage = storage;
  metadata.compression = compression_of(file, bag);
  for (const YAML::Node& path : bag["relative_file_paths"]) {
    // Early versions put the bag's folder before the name.
    metadata.files.push_back(fs::path(path.as<std::string>()).filename().string());
  }
  if (metadata.files.empty()) {
    throw DatasetError(file,
                       "relative_file_paths names no file; 'ros2 bag reindex' finds them, or "
                       "give the .db3 or .mcap file itself");
  }
  return metadata;
}

void write_topic(YAML::Emitter& yaml, const BagTopic& topic) {
  yaml << YAML::BeginMap << YAML::Key << "topic_metadata" << YAML::Value << YAML::BeginMap;
  yaml << YAML::Key << "name" << YAML::Value << topic.name;
  yaml << YAML::Key << "type" << YAML::Value << topic.type;
  yaml << YAML::Key << "serialization_format" << YAML::Value << topic.serialization_format;
  yaml << YAML::Key << "offered_qos_profiles" << YAML::Value << YAML::DoubleQuoted
       << topic.offered_qos_profiles << YAML::EndMap;
  yaml << YAML::Key << "message_count" << YAML::Value << topic.messages << YAML::EndMap;
}

void write_number(YAML::Emitter& yaml, const char* name, const char* unit, std::int64_t value) {
  yaml << YAML::Key << name << YAML::Value << YAML::BeginMap << YAML::Key << unit << YAML::Value
       << value << YAML::EndMap;
}

std::string to_yaml(const BagMetadata& metadata) {
  std::uint64_t messages = 0;
  for (const BagTopic& topic : metadata.topics) messages += topic.messages;
  YAML::Emitter yaml;
  yaml << YAML::BeginMap << YAML::Key << "rosbag2_bagfile_information" << YAML::Value
       << YAML::BeginMap;
  yaml << YAML::Key << "version" << YAML::Value << written_version;
  yaml << YAML::Key << "storage_identifier" << YAML::Value << metadata.storage;
  write_number(yaml, "duration", "nanoseconds", metadata.duration_ns);
  write_number(yaml, "starting_time", "nanoseconds_since_epoch", metadata.start_ns);
  yaml << YAML::Key << "message_count" << YAML::Value << messages;
  yaml << YAML::Key << "topics_with_message_count" << YAML::Value << YAML::BeginSeq;
  for (const BagTopic& topic : metadata.topics) write_topic(yaml, topic);
  yaml << YAML::EndSeq;
  yaml << YAML::Key << "compression_format" << YAML::Value << YAML::DoubleQuoted << "";
  yaml << YAML::Key << "compression_mode" << YAML::Value << YAML::DoubleQuoted << "";
  yaml << YAML::Key << "relative_file_paths" << YAML::Value << metadata.files;
  yaml << YAML::Key << "files" << YAML::Value << YAML::BeginSeq;
  for (const std::string& file : metadata.files) {
    yaml << YAML::BeginMap << YAML::Key << "path" << YAML::Value << file;
    write_number(yaml, "starting_time", "nanoseconds_since_epoch", metadata.start_ns);
    write_number(yaml, "duration", "nanoseconds", metadata.duration_ns);
    yaml << YAML::Key << "message_count" << YAML::Value << messages << YAML::EndMap;
  }
  yaml << YAML::EndSeq << YAML::EndMap << YAML::EndMap;
  return yaml.c_str();
}

}  // namespace

std::string conversion_hint() {
  return "with ROS 2, 'ros2 bag convert -i BAG -o out.yaml', where out.yaml says 'output_bags: "
         "[{uri: NEW_BAG, storage_id: sqlite3, all: true}]', makes one that is";
}

BagMetadata read_bag_metadata(const fs::path& file) {
  try {
    return metadata_of(file, YAML::LoadFile(file.string()));
  } catch (const YAML::Exception& fault) {
    throw DatasetError(file, std::string("cannot be read: ") + fault.what() +
                                 "; give the .db3 or .mcap file itself");
  }
}

void write_bag_metadata(const fs::path& file, const BagMetadata& metadata) {
  fs::path unfinished = file;
  unfinished += ".new";
  std::ofstream out(unfinished, std::ios::trunc);
  out << to_yaml(metadata) << '\n';
  out.close();
  std::error_code error;
  if (out) fs::rename(unfinished, file, error);
  if (!out || error) {
    throw DatasetWriteError(file, "cannot be written; check the folder and the space left");
  }
}

}  // namespace stillmap::dds
