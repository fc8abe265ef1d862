#include "clients/commands/dataset/recording.hpp"

#include <iostream>
#include <stdexcept>

#include "clients/commands/command.hpp"
#include "config/loaders/server_config.hpp"
#include "core/dataset/dataset_error.hpp"

namespace stillmap::cli {
namespace {

dds::Recording opened(const std::string& path, const std::string& topic,
                      std::optional<LabelKind> label_kind,
                      std::size_t clouds_per_turn = TurnJoiner::automatic,
                      const PointFieldNames& fields = {}, bool is_mount_known = false) {
  dds::Recording recording = dds::open_recording(path, topic, label_kind, fields);
  recording.dataset.join_turns(clouds_per_turn);
  for (const auto& sentences : {recording.faults, recording.dataset.remarks(is_mount_known)})
    for (const std::string& sentence : sentences) std::cerr << "stillmap: " << sentence << "\n";
  return recording;
}

/// Nothing where nobody says classes: SemanticKITTI's are the default of the configuration.
std::optional<LabelKind> label_kind_of(const RecordingArguments& recording,
                                       const InputConfig& configured) {
  if (recording.label_kind == "classes") return LabelKind::classes;
  if (!recording.label_kind.empty()) return LabelKind::semantic_kitti;
  const bool are_classes = configured.label_kind == LabelKind::classes;
  return are_classes ? std::optional(LabelKind::classes) : std::nullopt;
}

/// What is wrong with the labels, and the ways out; else empty.
std::string doubt_of_label_kind(const ScanDataset& dataset) {
  const std::string doubt = dataset.label_census().doubt();
  if (doubt.empty()) return {};
  return "the labels of " + dataset.file(0).string() +
         " and others would be read as SemanticKITTI ids and " + doubt +
         ". --label-kind classes reads them as classes (0 is unlabeled, 1 car, 9 road: where 0 is "
         "car, add 1 first), --label-kind semantic_kitti as they are; 'stillmap map --labels "
         "model' does without them; 'stillmap dataset export IN OUT --label-kind classes' writes a "
         "sequence with ids for commands without that option";
}

}  // namespace

void add_recording_options(CommandHandle command, RecordingArguments& recording) {
  command.option("--topic-in", recording.topic_in, topic_in_help);
  command
      .option("--label-kind", recording.label_kind,
              "What the numbers in its labels are: semantic_kitti (original ids), classes (0 to "
              "19); default: as in --config, else semantic_kitti if they look like it")
      .one_of({"semantic_kitti", "classes"});
  command
      .option(
          "--clouds-per-turn", recording.clouds_per_turn,
          "So many clouds that follow each other are a turn of the lidar, and one scan; 1: each "
          "is a scan, 0: found out; default: as in --config, else 0")
      .zero_to(TurnJoiner::most);
}

ScanDataset open_recording(const std::string& path, const std::string& topic) {
  return opened(path, topic, std::nullopt).dataset;
}

dds::Recording open_recording(const std::string& path, const RecordingArguments& recording,
                              const std::string& config_file, bool is_strict, bool is_mount_given) {
  const ServerConfig server =
      config_file.empty() ? ServerConfig{} : load_server_config(config_file);
  const InputConfig& input = server.input;
  const bool is_mount_known =
      is_mount_given || !server.frames.base.empty() || !server.lidars.empty();
  dds::Recording found = opened(path, recording.topic_in, label_kind_of(recording, input),
                                recording.clouds_per_turn.value_or(input.clouds_per_turn),
                                input.fields, is_mount_known);
  if (is_strict && !found.lost_parts.empty()) {
    throw DatasetError(
        path, "is not read as a whole, which --strict asks for: " + found.lost_parts.front());
  }
  const LabelCensus& census = found.dataset.label_census();
  if (census.unknown() > 0 && census.doubt().empty()) {
    std::cerr << "stillmap: " << census.unknown() << " of " << census.labels()
              << " labels of some scans have ids that SemanticKITTI does not have: they count as "
                 "unlabeled\n";
  }
  return found;
}

void require_semantic_kitti_labels(const ScanDataset& dataset) {
  if (const std::string doubt = doubt_of_label_kind(dataset); !doubt.empty())
    throw std::invalid_argument(doubt);
}

void warn_of_label_kind(const ScanDataset& dataset) {
  const std::string doubt = doubt_of_label_kind(dataset);
  if (!doubt.empty()) std::cerr << "stillmap: " << doubt << "\n";
}

}  // namespace stillmap::cli
