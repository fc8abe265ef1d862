#include "clients/commands/mapping/run_file.hpp"

#include <algorithm>
#include <sstream>
#include <stdexcept>
#include <utility>

namespace stillmap::cli {
namespace {

constexpr const char* dataset_key = "run_dataset";
constexpr const char* settings_key = "run_settings";
constexpr const char* scans_key = "run_scans";
constexpr const char* next_key = "run_next_scan";

std::chrono::steady_clock::time_point after(std::chrono::duration<double> period) {
  return std::chrono::steady_clock::now() +
         std::chrono::duration_cast<std::chrono::steady_clock::duration>(period);
}

constexpr const char* between_settings = ", ";

std::vector<std::string> parts_of(const std::string& settings) {
  std::vector<std::string> parts;
  for (std::size_t begin = 0; begin <= settings.size();) {
    const std::size_t end = std::min(settings.find(between_settings, begin), settings.size());
    parts.push_back(settings.substr(begin, end - begin));
    begin = end + std::string(between_settings).size();
  }
  return parts;
}

/// The parts of `settings` that `others` do not have.
std::string parts_without(const std::vector<std::string>& settings,
                          const std::vector<std::string>& others) {
  std::string text;
  for (const std::string& part : settings) {
    if (std::ranges::find(others, part) != others.end()) continue;
    text += (text.empty() ? "" : between_settings) + part;
  }
  return text;
}

std::string difference_in_words(const std::string& earlier, const std::string& now) {
  if (earlier.empty()) return "without " + now;
  return "with " + earlier + (now.empty() ? ", which is not asked for now" : ", not with " + now);
}

}  // namespace

std::pair<std::string, std::string> different_parts(const std::string& one,
                                                    const std::string& other) {
  const std::vector<std::string> ones = parts_of(one), others = parts_of(other);
  return {parts_without(ones, others), parts_without(others, ones)};
}

RunFile::RunFile(std::filesystem::path file, RunIdentity run, std::chrono::duration<double> period)
    : file_(std::move(file)),
      run_(std::move(run)),
      period_(period),
      store_(open_map_file(file_)),
      due_(after(period)) {}

std::optional<RunState> RunFile::earlier() const {
  RunState state{.map = store_->load(), .scan_of_pose = {}, .next_scan = 0};
  const auto& said = state.map.metadata;
  if (!said.contains(next_key)) return std::nullopt;
  if (said.at(dataset_key) != run_.dataset) {
    throw std::invalid_argument(file_.string() + " is of a run over " + said.at(dataset_key) +
                                ", not over " + run_.dataset +
                                ": name that recording, or begin anew "
                                "with --force");
  }
  // Older versions did not say.
  if (said.contains(settings_key) && said.at(settings_key) != run_.settings) {
    const auto [earlier, now] = different_parts(said.at(settings_key), run_.settings);
    throw std::invalid_argument(file_.string() + " is of a run " +
                                difference_in_words(earlier, now) +
                                ": ask for the same, or begin anew with --force");
  }
  const auto scans = from_ranges(said.at(scans_key));
  const auto next = from_ranges(said.at(next_key));
  if (!scans || scans->size() != state.map.trajectory.size() || !next || next->size() != 1) {
    throw MapFileError(file_, "does not say which scans are in it; begin anew with --force");
  }
  state.scan_of_pose = *scans;
  state.next_scan = next->front();
  return state;
}

void RunFile::save(RunState state) {
  state.map.metadata[dataset_key] = run_.dataset;
  state.map.metadata[settings_key] = run_.settings;
  state.map.metadata[scans_key] = to_ranges(state.scan_of_pose);
  state.map.metadata[next_key] = std::to_string(state.next_scan);
  store_->save(state.map);
  due_ = after(period_);
}

std::string to_ranges(const std::vector<std::size_t>& indices) {
  std::string text;
  for (std::size_t i = 0; i < indices.size();) {
    std::size_t end = i + 1;
    while (end < indices.size() && indices[end] == indices[end - 1] + 1) ++end;
    text += (text.empty() ? "" : ",") + std::to_string(indices[i]);
    if (end - i > 1) text += "-" + std::to_string(indices[end - 1]);
    i = end;
  }
  return text;
}

std::optional<std::vector<std::size_t>> from_ranges(const std::string& text) {
  constexpr std::size_t max_indices = 10'000'000;
  std::vector<std::size_t> indices;
  std::istringstream ranges(text);
  for (std::string range; std::getline(ranges, range, ',');) {
    std::istringstream numbers(range);
    std::size_t first = 0;
    if (!(numbers >> first)) return std::nullopt;
    std::size_t last = first;
    char dash = '-';
    if (!numbers.eof() && !(numbers >> dash >> last)) return std::nullopt;
    const bool ascends = indices.empty() || first > indices.back();
    if (dash != '-' || !numbers.eof() || !ascends || last < first || last >= max_indices) {
      return std::nullopt;
    }
    for (std::size_t i = first; i <= last; ++i) indices.push_back(i);
  }
  return indices;
}

}  // namespace stillmap::cli
