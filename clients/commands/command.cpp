#include "clients/commands/command.hpp"

#include <iostream>
#include <stdexcept>

#include "clients/library/client.hpp"
#include "config/loaders/config_error.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/map/storage/map_file.hpp"
#include "core/segmentation/model_error.hpp"
#include "core/session/map_alignment.hpp"
#include "idl/dds/dds_error.hpp"

namespace stillmap::cli {
namespace {

ExitCode report(const std::exception& error, ExitCode code) {
  // Writing to cerr flushes cout, which must not throw again.
  std::cout.exceptions(std::ios::goodbit);
  std::cerr << "stillmap: " << error.what() << "\n";
  return code;
}

/// Of a file that could not be written: one in a folder that was none was never asked for rightly.
ExitCode code_of_unwritten(bool had_folder) {
  return had_folder ? ExitCode::failed : ExitCode::bad_input;
}

}  // namespace

ExitCode run_action(const Action& action) {
  try {
    // A command that prints for ever ends when nobody can get it any more.
    std::cout.exceptions(std::ios::badbit);
    const ExitCode code = action();
    std::cout.flush();
    std::cout.exceptions(std::ios::goodbit);
    return code;
  } catch (const std::ios_base::failure& error) {
    if (!std::cout.bad()) return report(error, ExitCode::failed);
    return report(std::runtime_error("the output cannot be written to stdout; is the disk full?"),
                  ExitCode::failed);
  } catch (const ServiceTimeout& error) {
    return report(error, ExitCode::no_server);
  } catch (const ServiceError& error) {
    const bool is_input = error.code() == wire::ReplyCode::invalid_request;
    return report(error, is_input ? ExitCode::bad_input : ExitCode::failed);
  } catch (const DatasetWriteError& error) {
    return report(error, code_of_unwritten(error.had_folder()));
  } catch (const MapFileWriteError& error) {
    return report(error, code_of_unwritten(error.had_folder()));
  } catch (const DatasetError& error) {
    return report(error, ExitCode::bad_input);
  } catch (const ConfigError& error) {
    return report(error, ExitCode::bad_input);
  } catch (const ModelError& error) {
    return report(error, ExitCode::bad_input);
  } catch (const MapFileError& error) {
    return report(error, ExitCode::bad_input);
  } catch (const dds::SecurityError& error) {
    return report(error, ExitCode::bad_input);
  } catch (const MapNotRecognized& error) {
    return report(error, ExitCode::not_recognized);
  } catch (const std::invalid_argument& error) {
    return report(error, ExitCode::bad_input);
  } catch (const std::exception& error) {
    return report(error, ExitCode::failed);
  }
}

int run_program(CommandLine& command_line, int argc, char** argv, const Action& action) {
  switch (command_line.parse(argc, argv)) {
    case CommandLine::Parsed::wrong_usage:
      return static_cast<int>(ExitCode::bad_input);
    case CommandLine::Parsed::answered:
      return static_cast<int>(run_action([] { return ExitCode::ok; }));
    case CommandLine::Parsed::command:
      break;
  }
  return static_cast<int>(run_action(action));
}

}  // namespace stillmap::cli
