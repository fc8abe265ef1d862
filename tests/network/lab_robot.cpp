// A robot for network tests: publishes the scans of a recording again and again as a lidar driver
// does, stamped with the time at which they leave.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <thread>
#include <vector>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/library/client.hpp"
#include "clients/library/scan_publisher.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "core/dataset/scan_dataset.hpp"

namespace stillmap {
namespace {

using Clock = std::chrono::steady_clock;

struct Arguments {
  cli::ClientArguments client;
  std::string dataset;
  int scans = 0;
  double rate_hz = 10.0;
};

std::vector<DatasetFrame> read_frames(const Arguments& arguments) {
  const ScanDataset dataset(arguments.dataset);
  std::vector<DatasetFrame> frames;
  for (std::size_t i = 0; i < dataset.size(); ++i) {
    frames.push_back(dataset.read(i));
    for (float& value : frames.back().scan.intensity) {
      value /= dataset.suggested_sensor().intensity_scale;
    }
  }
  return frames;
}

/// There and back, so that a recording of any length is a drive without a jump; slowly at both
/// ends, as no robot turns round at full speed between two scans.
std::size_t to_and_fro(std::size_t step, std::size_t frames) {
  const auto last = static_cast<double>(frames - 1);
  if (frames < 2) return 0;
  const double phase = std::numbers::pi * static_cast<double>(step) / last;
  return static_cast<std::size_t>(std::lround(0.5 * last * (1.0 - std::cos(phase))));
}

cli::ExitCode drive(const Arguments& arguments) {
  cli::StopSignal stop;
  std::vector<DatasetFrame> frames = read_frames(arguments);
  Client client(arguments.client.client());
  ScanPublisher publisher(client, {.dds = arguments.client.dds(DdsRole::sensor)});
  if (!publisher.wait_for_subscriber(arguments.client.timeout())) return cli::ExitCode::no_server;
  const auto period = std::chrono::duration<double>(1.0 / arguments.rate_hz);
  const auto began = Clock::now();
  int sent = 0;
  while (sent < arguments.scans && !stop.requested()) {
    DatasetFrame& frame = frames[to_and_fro(static_cast<std::size_t>(sent), frames.size())];
    frame.scan.stamp_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(
                              std::chrono::system_clock::now().time_since_epoch())
                              .count();
    if (publisher.publish(frame.scan, frame.raw_labels)) ++sent;
    if (sent == 1) std::fprintf(stderr, "driving\n");
    std::this_thread::sleep_until(began + sent * period);
  }
  std::printf("{\"published\": %d}\n", sent);
  return cli::ExitCode::ok;
}

}  // namespace
}  // namespace stillmap

int main(int argc, char** argv) {
  stillmap::cli::CommandLine line("lab_robot", "", "A lidar driver for network tests.");
  stillmap::Arguments arguments;
  auto root = line.root();
  root.option("DATASET", arguments.dataset, "Recording").required();
  root.option("--scans", arguments.scans, "Scans to publish").required();
  root.option("--rate", arguments.rate_hz, "Scans a second").above_zero();
  stillmap::cli::add_client_options(root, arguments.client);
  return stillmap::cli::run_program(line, argc, argv, [&] { return stillmap::drive(arguments); });
}
