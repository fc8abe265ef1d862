#pragma once

#include <filesystem>
#include <functional>

#include "clients/commands/dataset/sequence_output.hpp"
#include "clients/commands/mapping/mapping_run.hpp"

namespace stillmap::cli {

/// Writes a recording as a SemanticKITTI sequence: every point of every scan as it is, poses from
/// our odometry, and for labels the recording's own where a scan has them, else the guess of
/// `labels`. `scan_done` as for map_dataset. Throws DatasetError.
[[nodiscard]] ExportSummary export_sequence(const ScanDataset& dataset, const ScanRange& range,
                                            const MapperConfig& config,
                                            std::unique_ptr<Segmenter> labels,
                                            const std::filesystem::path& folder,
                                            const ScanDone& scan_done,
                                            const ScanSkipped& scan_skipped);

}  // namespace stillmap::cli
