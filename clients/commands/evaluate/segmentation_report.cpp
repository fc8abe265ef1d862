#include "clients/commands/evaluate/segmentation_report.hpp"

#include <nlohmann/json.hpp>
#include <optional>

#include "clients/terminal/table.hpp"
#include "core/evaluation/confusion_matrix.hpp"

namespace stillmap::cli {
namespace {

std::string percent(const std::optional<double>& share) {
  return share ? fixed(100.0 * *share, 2) : "-";
}

nlohmann::json share_or_null(const std::optional<double>& share) {
  return share ? nlohmann::json(*share) : nlohmann::json(nullptr);
}

}  // namespace

nlohmann::json to_json(const evaluation::ConfusionMatrix& matrix) {
  nlohmann::json by_class = nlohmann::json::object();
  for (std::size_t k = 1; k < semantic_class_count; ++k) {
    const auto label = static_cast<SemanticClass>(k);
    by_class[std::string(name(label))] = share_or_null(matrix.iou(label));
  }
  nlohmann::json by_group = nlohmann::json::object();
  for (const evaluation::ClassGroup& group : evaluation::coarse_groups()) {
    by_group[std::string(group.name)] = share_or_null(matrix.iou(group.classes));
  }
  return {{"points", matrix.total()},
          {"miou", matrix.mean_iou()},
          {"miou_present", matrix.mean_iou_of_present().value_or(0.0)},
          {"accuracy", matrix.accuracy().value_or(0.0)},
          {"iou", by_class},
          {"iou_of_groups", by_group}};
}

std::string describe(const evaluation::ConfusionMatrix& matrix) {
  Table classes({"class", "IoU %"});
  for (std::size_t k = 1; k < semantic_class_count; ++k) {
    const auto label = static_cast<SemanticClass>(k);
    classes.add({std::string(name(label)), percent(matrix.iou(label))});
  }
  classes.add({"mean of 19", percent(matrix.mean_iou())});
  classes.add({"mean of those seen", percent(matrix.mean_iou_of_present())});
  classes.add({"accuracy", percent(matrix.accuracy())});
  Table groups({"group", "IoU %"});
  for (const evaluation::ClassGroup& group : evaluation::coarse_groups()) {
    groups.add({std::string(group.name), percent(matrix.iou(group.classes))});
  }
  std::string text = classes.text();
  text.append("\n").append(groups.text()).append(std::to_string(matrix.total()));
  return text.append(" labelled points; unlabeled truth is left out, as in semantic-kitti-api\n");
}

}  // namespace stillmap::cli
