#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "clients/commands/arguments/mapper_arguments.hpp"
#include "clients/terminal/command_line.hpp"
#include "core/mapper.hpp"
#include "core/segmentation/drive_votes.hpp"

namespace stillmap::cli {

/// Adds --drive-votes, which says "on" or "off"; empty where it is not given, which is on.
OptionHandle add_drive_votes_option(CommandHandle command, std::string& drive_votes);

/// Whoever has time for the votes of a drive has it for what a network sees in a mirror: with them
/// --mirrored is on where it is not given.
void mirror_with_drive_votes(const std::string& drive_votes, MapperArguments& mapper);

/// The labels that a segmenter found for the scans of a recorded drive, after the votes of the
/// scans around each, for whoever has poses of them.
class DriveLabels {
 public:
  /// Without votes, labels are as they were found.
  explicit DriveLabels(bool is_voted) : is_voted_(is_voted) {}

  /// The next scan, with the classes of its usable points, as Mapper::process() left it.
  void add(const MappedScan& mapped, PointLabels labels);
  /// The next scan has no labels to vote on: without a good pose it parts what was before from what
  /// follows.
  void pass(const std::optional<MappedScan>& mapped);
  /// The next scan has no pose.
  void add_without_pose(PointLabels labels) { votes_.add({}, std::move(labels), std::nullopt); }

  /// No scan follows on these.
  void finish() { votes_.finish(); }
  /// As DriveVotes::take().
  [[nodiscard]] std::optional<PointLabels> take() { return votes_.take(); }

 private:
  bool is_voted_;
  DriveVotes votes_;
};

/// The same for labels of all points of scans that nobody else maps: a mapper of its own, without
/// labels, finds their poses.
class DriveScans {
 public:
  explicit DriveScans(const MapperConfig& config);

  /// The next scan; with labels, all its points'. Points that a mapper leaves out keep theirs.
  void add(const Scan& scan, std::optional<PointLabels> labels);
  void finish() { votes_.finish(); }
  /// Whether scans were added since leave(), which the next one lies to.
  [[nodiscard]] bool is_begun() const { return is_begun_; }
  /// The next scans are elsewhere.
  void leave();
  /// Of the scans that had labels, in their order.
  [[nodiscard]] std::optional<PointLabels> take();

 private:
  struct Waiting {
    PointLabels of_all;
    std::vector<std::uint32_t> usable;
  };

  PrepareConfig prepare_;
  Mapper mapper_;
  std::uint64_t maps_ = 0;
  /// Something was added since leave().
  bool is_begun_ = false;
  DriveLabels votes_{true};
  std::deque<Waiting> waiting_;
};

}  // namespace stillmap::cli
