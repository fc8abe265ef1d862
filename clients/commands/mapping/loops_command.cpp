#include <cstddef>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "clients/commands/command.hpp"
#include "clients/terminal/table.hpp"
#include "core/dataset/dataset_error.hpp"

namespace stillmap::cli {
namespace {

struct LoopsArguments {
  std::string folder;
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

ExitCode run(const LoopsArguments& arguments) {
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

}  // namespace

void add_loops_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<LoopsArguments>();
  CommandHandle command = program.command(
      "loops", "List the places where a mapped drive came back, and what was refused");
  command.option("RUN", arguments->folder, "The folder that 'stillmap map' wrote").required();
  command.flag("--refused", arguments->refused, "List the refused ones, too, with the reason");
  command.flag("--json", arguments->json, "Print JSON: all of both, with the transforms");
  command.explain(
      "Examples:\n"
      "  stillmap loops kitti00 --refused\n"
      "  stillmap map sequences/00 --out kitti00 --force --deny-loop 312:1580\n"
      "A closure joins the places of two scans, FROM:TO. 'moved' is by how much the later one "
      "moved against\n"
      "what was known until then; 'overlap' is the share of one place that lies where the other "
      "has points;\n"
      "'score' says how well what stands up fits, 1 perfectly; 'next best' is the second best "
      "place beside the\n"
      "best, by plan. One that is wrong is undone by mapping again with --deny-loop FROM:TO: the "
      "same scans give\n"
      "the same submaps, and nothing joins these two or their neighbours. loops_after.png shows "
      "them over the map.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
