#include "clients/commands/security/authority_topic_names.hpp"

#include <fstream>
#include <nlohmann/json.hpp>

#include "idl/dds/dds_error.hpp"

namespace stillmap::cli {
namespace {

std::filesystem::path file_in(const std::filesystem::path& authority_folder) {
  return authority_folder / "authority" / "topics.json";
}

}  // namespace

void save_topic_names(const dds::TopicNames& names, const std::filesystem::path& authority_folder) {
  const std::filesystem::path file = file_in(authority_folder);
  std::ofstream out(file);
  out << nlohmann::json{{"points", names.points},
                        {"odometry_prior", names.odometry_prior},
                        {"namespace", names.name_space}}
             .dump(2)
      << "\n";
  out.close();
  if (!out) throw dds::SecurityError(file.string() + " cannot be written");
}

dds::TopicNames load_topic_names(const std::filesystem::path& authority_folder) {
  const std::filesystem::path file = file_in(authority_folder);
  std::ifstream in(file);
  try {
    const auto json = nlohmann::json::parse(in);
    return {.points = json.at("points"),
            .odometry_prior = json.at("odometry_prior"),
            .name_space = json.at("namespace")};
  } catch (const nlohmann::json::exception& error) {
    throw dds::SecurityError(file.string() + " does not name the topics (" + error.what() +
                             "); restore it, or make a new authority");
  }
}

}  // namespace stillmap::cli
