#include "clients/commands/server_control/status_report.hpp"

#include <map>

#include "clients/terminal/json.hpp"
#include "clients/terminal/table.hpp"

namespace stillmap::cli {

std::string status_text(const dds::ServerStatus& status) {
  std::string text = "stillmap-server " + status.software_version + ", up for " +
                     fixed(status.uptime_s, 0) + " s\n";
  text += "health     " + std::string(name(status.health)) +
          (status.reason.empty() ? "" : ": " + status.reason) + "\n";
  text += "labels     " + status.label_source + "\n";
  const dds::SegmentationStatus& segmentation = status.segmentation;
  const std::string columns = std::to_string(segmentation.image_columns);
  text += "           " + dds::every_nth_scan(segmentation.interval) + " segmented" +
          (segmentation.image_columns > 0 ? " in " + columns + " columns, " : ", ") +
          fixed(segmentation.inference_ms, 1) + " ms each; of the last scans " +
          fixed(100.0 * segmentation.fresh_share, 0) + " % with their own labels, " +
          fixed(100.0 * segmentation.propagated_share, 0) + " % with propagated labels, " +
          fixed(100.0 * segmentation.unlabelled_share, 0) + " % with none\n";
  text += "scans      " + fixed(status.received_hz, 1) + "/s in, " + fixed(status.mapped_hz, 1) +
          "/s mapped; delivery: " + name(status.delivery) + "\n";
  text += "map        id " + std::to_string(status.map_id) + ", version " +
          std::to_string(status.map_version) + ": " + std::to_string(status.voxel_count) +
          " voxels in " + std::to_string(status.tile_count) + " tiles\n";
  for (const dds::Diagnostic& diagnostic : status.diagnostics) {
    text +=
        std::string(diagnostic.severity == dds::Severity::problem ? "problem    " : "advice     ") +
        diagnostic.what + "; " + diagnostic.hint + "\n";
  }
  Table counters({"counter", "of", "value"});
  for (const dds::NamedCounter& counter : status.counters) {
    counters.add({counter.name, counter.detail, std::to_string(counter.value)});
  }
  Table latencies({"ms a scan", "p50", "p99", "max", "scans"});
  for (const dds::StageLatency& stage : status.latencies) {
    latencies.add({stage.stage, fixed(stage.p50_ms, 1), fixed(stage.p99_ms, 1),
                   fixed(stage.max_ms, 1), std::to_string(stage.samples)});
  }
  return text + "\n" + counters.text() + "\n" + latencies.text();
}

namespace {

Json to_json(const dds::SegmentationStatus& segmentation) {
  return {{"interval", segmentation.interval},
          {"inference_ms", segmentation.inference_ms},
          {"image_columns", segmentation.image_columns},
          {"full_columns", segmentation.full_columns},
          {"fresh_share", segmentation.fresh_share},
          {"propagated_share", segmentation.propagated_share},
          {"unlabelled_share", segmentation.unlabelled_share}};
}

/// Those of one name are an object by what they are of: {"scans_dropped": {"queue_full": 3}}.
Json to_json(const std::vector<dds::NamedCounter>& all) {
  std::map<std::string, std::map<std::string, std::uint64_t>> detailed;
  Json counters = Json::object();
  for (const dds::NamedCounter& counter : all) {
    if (counter.detail.empty()) {
      counters.set(counter.name, counter.value);
    } else {
      detailed[counter.name][counter.detail] = counter.value;
    }
  }
  for (const auto& [name, values] : detailed) counters.set(name, values);
  return counters;
}

Json to_json(const std::vector<dds::StageLatency>& stages) {
  Json latencies = Json::object();
  for (const dds::StageLatency& stage : stages) {
    latencies.set(stage.stage, {{"p50_ms", stage.p50_ms},
                                {"p99_ms", stage.p99_ms},
                                {"max_ms", stage.max_ms},
                                {"samples", stage.samples}});
  }
  return latencies;
}

Json to_json(const std::vector<dds::Diagnostic>& all) {
  Json diagnostics = Json::array();
  for (const dds::Diagnostic& diagnostic : all) {
    diagnostics.push_back(
        {{"severity", diagnostic.severity == dds::Severity::problem ? "problem" : "advice"},
         {"what", diagnostic.what},
         {"evidence", diagnostic.evidence},
         {"hint", diagnostic.hint}});
  }
  return diagnostics;
}

}  // namespace

Json status_json(const dds::ServerStatus& status) {
  return {{"stamp_ns", status.stamp_ns},
          {"software_version", status.software_version},
          {"uptime_s", status.uptime_s},
          {"delivery", name(status.delivery)},
          {"label_source", status.label_source},
          {"health", name(status.health)},
          {"reason", status.reason},
          {"received_hz", status.received_hz},
          {"mapped_hz", status.mapped_hz},
          {"segmentation", to_json(status.segmentation)},
          {"map_version", status.map_version},
          {"map_id", status.map_id},
          {"tiles", status.tile_count},
          {"voxels", status.voxel_count},
          {"dropped", status.dropped()},
          {"counters", to_json(status.counters)},
          {"latencies", to_json(status.latencies)},
          {"host", status.host},
          {"sensor", status.sensor},
          {"points_topic", status.points_topic},
          {"scan_frame", status.scan_frame},
          {"scan_delay_s", status.scan_delay_s},
          {"diagnostics", to_json(status.diagnostics)}};
}

}  // namespace stillmap::cli
