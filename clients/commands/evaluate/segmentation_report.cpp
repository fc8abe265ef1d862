#include "clients/commands/evaluate/segmentation_report.hpp"

#include <optional>

#include "clients/terminal/table.hpp"

namespace stillmap::cli {
namespace {

using evaluation::ClassGroup;
using evaluation::ConfusionMatrix;
using evaluation::SegmentationScore;

std::string percent(const std::optional<double>& share, int decimals = 2) {
  return share ? fixed(100.0 * *share, decimals) : "-";
}

Json share_or_null(const std::optional<double>& share) {
  return share ? Json(*share) : Json(nullptr);
}

SegmentationScore sum(const std::vector<SequenceScore>& sequences) {
  SegmentationScore all;
  for (const SequenceScore& sequence : sequences) all.add(sequence.score);
  return all;
}

std::string band_name(std::size_t band) {
  const auto border = [](std::size_t k) { return fixed(SegmentationScore::borders_m.at(k), 0); };
  if (band == 0) return "< " + border(0) + " m";
  if (band + 1 == SegmentationScore::band_count) return "> " + border(band - 1) + " m";
  return border(band - 1) + "-" + border(band) + " m";
}

Json json_of(const ConfusionMatrix& matrix) {
  Json by_class = Json::object();
  for (std::size_t k = 1; k < semantic_class_count; ++k) {
    const auto label = static_cast<SemanticClass>(k);
    by_class.set(std::string(name(label)), share_or_null(matrix.iou(label)));
  }
  Json by_group = Json::object();
  for (const ClassGroup& group : evaluation::coarse_groups()) {
    by_group.set(std::string(group.name), share_or_null(matrix.iou(group.classes)));
  }
  return {{"points", matrix.total()},
          {"miou", matrix.total() > 0 ? Json(matrix.mean_iou()) : Json(nullptr)},
          {"miou_present", share_or_null(matrix.mean_iou_of_present())},
          {"miou_groups", share_or_null(evaluation::mean_iou_of_groups(matrix))},
          {"accuracy", share_or_null(matrix.accuracy())},
          {"iou", by_class},
          {"iou_of_groups", by_group}};
}

/// Rows `label` and columns `all`, then the bands of range.
class RangeTable {
 public:
  RangeTable(const std::string& label, const SegmentationScore& score) : score_(score) {
    std::vector<std::string> head{label + ", IoU %", "all"};
    for (std::size_t band = 0; band < SegmentationScore::band_count; ++band) {
      head.push_back(band_name(band));
    }
    table_ = Table(head);
  }

  template <typename Measure>
  void add(const std::string& label, const Measure& measure) {
    std::vector<std::string> row{label, percent(measure(score_.all()))};
    for (std::size_t band = 0; band < SegmentationScore::band_count; ++band) {
      row.push_back(percent(measure(score_.band(band)), 1));
    }
    table_.add(row);
  }

  [[nodiscard]] std::string text() const { return table_.text() + "\n"; }

 private:
  const SegmentationScore& score_;
  Table table_{{}};
};

std::string class_table(const SegmentationScore& score) {
  RangeTable table("class", score);
  for (std::size_t k = 1; k < semantic_class_count; ++k) {
    const auto label = static_cast<SemanticClass>(k);
    table.add(std::string(name(label)), [&](const ConfusionMatrix& m) { return m.iou(label); });
  }
  table.add("mean of 19", [](const ConfusionMatrix& m) {
    return m.total() > 0 ? std::optional(m.mean_iou()) : std::nullopt;
  });
  table.add("mean of those seen", [](const ConfusionMatrix& m) { return m.mean_iou_of_present(); });
  table.add("accuracy", [](const ConfusionMatrix& m) { return m.accuracy(); });
  return table.text();
}

std::string group_table(const SegmentationScore& score) {
  RangeTable table("group", score);
  for (const ClassGroup& group : evaluation::coarse_groups()) {
    table.add(std::string(group.name),
              [&](const ConfusionMatrix& m) { return m.iou(group.classes); });
  }
  table.add("mean of those seen", evaluation::mean_iou_of_groups);
  return table.text();
}

std::string sequence_table(const std::vector<SequenceScore>& sequences) {
  Table table({"sequence", "mean of classes seen", "mean of groups", "accuracy"});
  for (const SequenceScore& sequence : sequences) {
    const ConfusionMatrix& matrix = sequence.score.all();
    table.add({sequence.sequence, percent(matrix.mean_iou_of_present()),
               percent(evaluation::mean_iou_of_groups(matrix)), percent(matrix.accuracy())});
  }
  return table.text() + "\n";
}

}  // namespace

Json segmentation_json(const std::vector<SequenceScore>& sequences) {
  const SegmentationScore score = sum(sequences);
  Json json = json_of(score.all());
  Json by_range = Json::array();
  for (std::size_t band = 0; band < SegmentationScore::band_count; ++band) {
    Json of_band = json_of(score.band(band));
    of_band.set("range", band_name(band));
    by_range.push_back(of_band);
  }
  json.set("by_range", by_range);
  Json by_sequence = Json::array();
  for (const SequenceScore& sequence : sequences) {
    Json of_sequence = json_of(sequence.score.all());
    of_sequence.set("sequence", sequence.sequence);
    by_sequence.push_back(of_sequence);
  }
  json.set("sequences", by_sequence);
  return json;
}

std::string segmentation_text(const std::vector<SequenceScore>& sequences) {
  const SegmentationScore score = sum(sequences);
  std::string text = sequences.size() > 1 ? sequence_table(sequences) : std::string();
  text.append(class_table(score)).append(group_table(score));
  text.append(std::to_string(score.all().total()));
  return text.append(" labelled points; unlabeled truth is left out, as in semantic-kitti-api\n");
}

}  // namespace stillmap::cli
