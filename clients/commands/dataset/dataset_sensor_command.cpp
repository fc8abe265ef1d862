#include <iostream>
#include <memory>
#include <numbers>

#include "clients/commands/command.hpp"
#include "clients/commands/dataset/recording.hpp"
#include "clients/terminal/table.hpp"
#include "config/loaders/sensor_file.hpp"

namespace stillmap::cli {
namespace {

struct DatasetSensorArguments {
  std::string dataset;
  std::string topic;
  std::string out;
};

ExitCode run(const DatasetSensorArguments& arguments) {
  const SensorModel sensor = open_recording(arguments.dataset, arguments.topic).suggested_sensor();
  constexpr double degree = std::numbers::pi / 180.0;
  std::cout << sensor.name << ": " << sensor.rings << " rings from "
            << fixed(sensor.fov_up / degree, 2) << " to " << fixed(sensor.fov_down / degree, 2)
            << " degrees of elevation\n";
  if (!arguments.out.empty()) {
    save_sensor(sensor, arguments.out);
    std::cout << "written to " << arguments.out << ": name it as 'sensor' in the server's file\n";
  }
  return ExitCode::ok;
}

}  // namespace

void add_dataset_sensor_command(CommandHandle dataset, Action& action) {
  auto arguments = std::make_shared<DatasetSensorArguments>();
  CommandHandle command = dataset.command("sensor", "Find out which sensor recorded a data set");
  command.option("DATASET", arguments->dataset, dataset_kinds).required();
  command.option("--topic-in", arguments->topic, topic_in_help);
  command.option("--out", arguments->out, "Write a sensor file (YAML) for the server");
  command.explain(
      "Example:\n"
      "  stillmap dataset sensor bag --out my_lidar.yaml\n"
      "Reads the first scan: the elevations of its rings, or where it numbers none, the field of\n"
      "view that its points fill, in 40 bands. Check the ranges in the file against the sensor's\n"
      "data sheet.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
