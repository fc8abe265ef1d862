#pragma once

#include <optional>
#include <string>

#include "clients/terminal/command_line.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "idl/bag/bag_scan_source.hpp"

namespace stillmap::cli {

/// What a command line says of a recording besides its path.
struct RecordingArguments {
  /// Of a bag with several topics of scans.
  std::string topic_in;
  /// "semantic_kitti" or "classes"; empty: as configured, else as SemanticKITTI's after a look.
  std::string label_kind;
  /// 0: they tell; nothing: as configured.
  std::optional<std::uint64_t> clouds_per_turn;
};

/// Adds --topic-in, --label-kind and --clouds-per-turn.
void add_recording_options(CommandHandle command, RecordingArguments& recording);

/// A dataset or bag, as dds::open_recording(), with clouds that are parts of turns joined; says on
/// standard error what of it cannot be read, and how it was understood (ScanDataset::remarks()).
/// Throws DatasetError.
[[nodiscard]] ScanDataset open_recording(const std::string& path, const std::string& topic);

/// The same by what the command line says, else by `input` in `config_file`, where there is one:
/// the kind of labels, clouds joined to turns, names of fields. Says how many labels are of no
/// known id; of other axes nothing where the command line (`is_mount_given`) or the file tells how
/// the lidar hangs. Throws ConfigError, too, and DatasetError where `is_strict` and a part of a bag
/// is missing, damaged, or left out.
[[nodiscard]] dds::Recording open_recording(const std::string& path,
                                            const RecordingArguments& recording,
                                            const std::string& config_file = {},
                                            bool is_strict = false, bool is_mount_given = false);

/// Throws std::invalid_argument, with the ways out, where labels are read as SemanticKITTI ids and
/// look like something else.
void require_semantic_kitti_labels(const ScanDataset& dataset);
/// Says the same on standard error.
void warn_of_label_kind(const ScanDataset& dataset);

}  // namespace stillmap::cli
