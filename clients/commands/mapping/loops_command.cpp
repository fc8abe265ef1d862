#include <condition_variable>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/terminal/table.hpp"
#include "core/dataset/dataset_error.hpp"

namespace stillmap::cli {
namespace {

struct LoopsArguments {
  /// Empty: those of a running server.
  std::string folder;
  ClientArguments client;
  bool refused = false;
  bool json = false;
};

/// report.json of a run. Throws DatasetError for what is none.
nlohmann::json read_report(const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / "report.json";
  std::ifstream in(file);
  if (!in) throw DatasetError(file, "cannot be read; name the folder that 'stillmap map' wrote");
  const nlohmann::json report = nlohmann::json::parse(in, nullptr, false);
  if (!report.is_object() || !report.contains("closures") || !report.contains("loops"))
    throw DatasetError(file, "is no report of 'stillmap map'");
  return report;
}

/// The value, as a number of so many digits; "-" where there is none.
std::string number(const nlohmann::json& closure, const char* name, int digits) {
  const auto value = closure.find(name);
  return value != closure.end() && value->is_number() ? fixed(value->get<double>(), digits) : "-";
}

void add_row(Table& table, const nlohmann::json& closure) {
  const auto refusal = closure.find("refusal");
  const bool is_refused = refusal != closure.end() && refusal->is_string();
  table.add({number(closure, "from_scan", 0) + ":" + number(closure, "to_scan", 0),
             number(closure, "jump_m", 2), number(closure, "overlap", 2),
             number(closure, "score", 2), number(closure, "runner_up", 2),
             is_refused ? "refused: " + refusal->get<std::string>() : "closed"});
}

ExitCode run_of_folder(const LoopsArguments& arguments) {
  const nlohmann::json report = read_report(arguments.folder);
  const nlohmann::json& closures = report.at("closures");
  if (!closures.is_array() || !report.at("loops").is_object()) {
    throw std::invalid_argument(arguments.folder +
                                ": loops were not looked for in this run (--loops off, or its "
                                "stamps were set back)");
  }
  const nlohmann::json refused = report.at("loops").value("refused", nlohmann::json::array());
  if (arguments.json) {
    std::cout << nlohmann::json{{"closures", closures}, {"refused", refused}}.dump(2) << "\n";
    return ExitCode::ok;
  }
  Table table({"scans", "moved [m]", "overlap", "score", "next best", "verdict"});
  for (const nlohmann::json& closure : closures) add_row(table, closure);
  if (arguments.refused)
    for (const nlohmann::json& closure : refused) add_row(table, closure);
  if (!closures.empty() || (arguments.refused && !refused.empty())) std::cout << table.text();
  std::cout << closures.size() << " closed, " << refused.size() << " refused\n";
  return ExitCode::ok;
}

/// What the server published last. Throws ServiceTimeout where it publishes none.
SubmapsOfMap submaps_of_server(const ClientArguments& arguments) {
  Client client = connect(arguments);
  std::mutex mutex;
  std::condition_variable arrived;
  std::optional<SubmapsOfMap> newest;
  const Subscription subscription = client.subscribe_submaps([&](const SubmapsOfMap& submaps) {
    const std::scoped_lock lock(mutex);
    newest = submaps;
    arrived.notify_all();
  });
  std::unique_lock lock(mutex);
  if (!arrived.wait_for(lock, arguments.timeout(), [&] { return newest.has_value(); })) {
    throw ServiceTimeout("the server '" + arguments.server_name + "' tells no submaps within " +
                         fixed(arguments.timeout_s, 1) +
                         " s: it closes no loops (map.close_loops: false), or is older");
  }
  return *newest;
}

nlohmann::json transform_json(const Eigen::Isometry3d& T) {
  const Eigen::Vector3d p = T.translation();
  const Eigen::Quaterniond q(T.linear());
  return {{"position_m", {p.x(), p.y(), p.z()}}, {"quaternion_xyzw", {q.x(), q.y(), q.z(), q.w()}}};
}

nlohmann::json to_json(const SubmapsOfMap& submaps) {
  nlohmann::json json{{"map_id", submaps.map_id},
                      {"graph_revision", submaps.list.graph_revision},
                      {"frame", submaps.frame},
                      {"child_frame", submaps.child_frame},
                      {"submaps", nlohmann::json::array()},
                      {"closures", nlohmann::json::array()}};
  for (const SubmapList::Entry& entry : submaps.list.submaps) {
    nlohmann::json submap = transform_json(entry.T_map_submap);
    submap["stamp_ns"] = entry.stamp_ns;
    submap["way_m"] = entry.way_m;
    json["submaps"].push_back(std::move(submap));
  }
  for (const SubmapList::Loop& loop : submaps.list.loops) {
    nlohmann::json closure = transform_json(loop.T_from_to);
    closure.update({{"from_submap", loop.from},
                    {"to_submap", loop.to},
                    {"overlap", loop.overlap},
                    {"score", loop.upright_fit},
                    {"jump_m", loop.jump_m}});
    json["closures"].push_back(std::move(closure));
  }
  return json;
}

ExitCode run_of_server(const LoopsArguments& arguments) {
  if (arguments.refused)
    throw std::invalid_argument("--refused is of a RUN: a server tells what it believes");
  const SubmapsOfMap submaps = submaps_of_server(arguments.client);
  if (arguments.json) {
    std::cout << to_json(submaps).dump(2) << "\n";
    return ExitCode::ok;
  }
  const SubmapList& list = submaps.list;
  Table table({"submaps", "way [m]", "moved [m]", "overlap", "score"});
  for (const SubmapList::Loop& loop : list.loops) {
    table.add(
        {std::to_string(loop.from) + ":" + std::to_string(loop.to),
         fixed(list.submaps[loop.from].way_m, 0) + ":" + fixed(list.submaps[loop.to].way_m, 0),
         fixed(loop.jump_m, 2), fixed(loop.overlap, 2), fixed(loop.upright_fit, 2)});
  }
  if (!list.loops.empty()) std::cout << table.text();
  std::cout << list.submaps.size() << " submaps, " << list.loops.size() << " loops closed, map "
            << submaps.map_id << " corrected " << list.graph_revision << " times\n";
  return ExitCode::ok;
}

ExitCode run(const LoopsArguments& arguments) {
  return arguments.folder.empty() ? run_of_server(arguments) : run_of_folder(arguments);
}

}  // namespace

void add_loops_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<LoopsArguments>();
  CommandHandle command = program.command(
      "loops", "List the places where a mapped drive came back, and what was refused");
  command.option("RUN", arguments->folder,
                 "The folder that 'stillmap map' wrote; without it, the running server is asked");
  command.flag("--refused", arguments->refused, "List the refused ones, too, with the reason");
  command.flag("--json", arguments->json, "Print JSON: all of both, with the transforms");
  add_client_options(command, arguments->client);
  command.explain(
      "Examples:\n"
      "  stillmap loops kitti00 --refused\n"
      "  stillmap map sequences/00 --out kitti00 --force --deny-loop 312:1580\n"
      "  stillmap loops --json | jq '.submaps[].position_m'   # of the running server\n"
      "A closure joins the places of two scans, FROM:TO. 'moved' is by how much the later one "
      "moved against what was known until then; 'overlap' is the share of one place that lies "
      "where the other has points; 'score' says how well what stands up fits, 1 perfectly; 'next "
      "best' is the second best place beside the best, by plan. One that is wrong is undone by "
      "mapping again with --deny-loop FROM:TO: the same scans give the same submaps, and nothing "
      "joins these two or their neighbours. loops_after.png shows them over the map.\n"
      "Of a server: "
      "closures join submaps by number, with the way until there; JSON has where each submap lies "
      "now. 'stillmap/submaps' is the topic.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
