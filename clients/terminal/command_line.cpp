#include "clients/terminal/command_line.hpp"

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <CLI/TypeTools.hpp>
#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <iterator>
#include <limits>
#include <span>
#include <sstream>
#include <string>
#include <vector>

#include "config/loaders/closest_name.hpp"

namespace stillmap::cli {
namespace {

/// CLI11's own range takes NaN for a number in it, and names its limits with 309 digits.
std::string fault_of_positive(const std::string& word, double most) {
  double value = 0.0;
  if (CLI::detail::lexical_cast(word, value) && std::isfinite(value) && value > 0.0 &&
      value <= most) {
    return {};
  }
  std::ostringstream fault;
  fault << "'" << word << "' must be a finite number above zero";
  if (std::isfinite(most)) fault << ", and " << static_cast<int>(most) << " at most";
  return fault.str();
}

/// CLI11 reads -1 as the greatest number that there is.
std::string fault_of_unsigned(const std::string& word) {
  const std::size_t first = word.find_first_not_of(" \t\n\v\f\r");
  if (first == std::string::npos || word[first] != '-') return {};
  return "'" + word + "' is negative; it must be a whole number of 0 or more";
}

constexpr const char* not_empty = "not empty";

std::string fault_of_text(const std::string& word) {
  return word.empty() ? "is empty; name something, or leave it out" : "";
}

/// CLI11 takes what begins with '-' and no digit for an option, numbers such as -inf and -.5, too.
/// After a blank they are values, and the same numbers.
std::string marked_number(const std::string& word) {
  const bool looks_like_option =
      word.size() > 1 && word[0] == '-' && std::isdigit(static_cast<unsigned char>(word[1])) == 0;
  double number = 0.0;
  // The first one of a list with commas.
  const bool is_number =
      looks_like_option && CLI::detail::lexical_cast(word.substr(0, word.find(',')), number);
  return is_number ? " " + word : word;
}

/// A number, or several with commas between.
bool is_numbers(const std::string& word) {
  std::istringstream parts(word);
  bool is_some = false;
  for (std::string part; std::getline(parts, part, ',');) {
    double number = 0.0;
    if (!CLI::detail::lexical_cast(part, number)) return false;
    is_some = true;
  }
  return is_some;
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    names.push_back(command->get_name());
  }
  return names;
}

/// Null where there is none of that name.
const CLI::App* command_of(const CLI::App& app, const std::string& name) {
  const auto found =
      app.get_subcommands([&](const CLI::App* command) { return command->get_name() == name; });
  return found.empty() ? nullptr : found.front();
}

/// CLI11 takes all words up to the next option for a list, also for one of a fixed length. A list
/// of numbers ends before a last word that is none: that word goes before the options, where it is
/// a value by its place.
void end_lists_of_numbers(const CLI::App& program, std::vector<std::string>& words) {
  const CLI::App* app = &program;
  const auto is_option = [](const std::string& word) { return word.starts_with('-'); };
  auto place = words.begin() + 1;
  for (; place != words.end() && !is_option(*place); ++place) {
    if (const CLI::App* const command = command_of(*app, *place)) app = command;
  }
  for (auto word = place; word != words.end() && *word != "--"; ++word) {
    const CLI::Option* const option = is_option(*word) ? app->get_option_no_throw(*word) : nullptr;
    if (option == nullptr || option->get_expected_max() <= 1) continue;
    const auto last = std::find_if_not(word + 1, words.end(), is_numbers);
    const bool is_value = last != words.end() && last != word + 1 && !is_option(*last);
    if (!is_value || (last + 1 != words.end() && !is_option(*(last + 1)))) continue;
    place = std::rotate(place, last, last + 1);
    word = last;
  }
}

/// Without "--".
std::vector<std::string> option_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options())
    std::ranges::copy(option->get_lnames(), std::back_inserter(names));
  return names;
}

/// The first command or option that does not exist but is written much as one that does: that one.
std::string meant(const CLI::App& program, std::span<const std::string> words) {
  const CLI::App* app = &program;
  for (const std::string& word : words) {
    if (word == "--") break;
    if (word.starts_with("--")) {
      const std::string name = word.substr(0, word.find('='));
      if (app->get_option_no_throw(name) == nullptr) {
        const std::string option = closest_name(name.substr(2), option_names(*app));
        if (!option.empty()) return "--" + option;
      }
    } else if (const CLI::App* const command = command_of(*app, word)) {
      app = command;
    } else if (app->get_require_subcommand_min() > 0) {
      return closest_name(word, command_names(*app));
    }
  }
  return {};
}

/// Whether one of the commands below the last one that was named must be, too.
bool lacks_command(const CLI::App& program) {
  const CLI::App* app = &program;
  while (!app->get_subcommands().empty()) app = app->get_subcommands().back();
  return app->get_require_subcommand_min() > 0;
}

/// What CLI11 says, but of words that mean nothing: it names them last first, or, where a command
/// is missing, not at all.
std::string describe_fault(const CLI::App* program, const CLI::Error& fault) {
  const std::vector<std::string> unknown = program->remaining(true);
  std::string text = fault.what();
  if (lacks_command(*program) && !unknown.empty() && !unknown.front().starts_with('-')) {
    text = "there is no command '" + unknown.front() + "'";
  } else if (fault.get_exit_code() == static_cast<int>(CLI::ExitCodes::ExtrasError)) {
    text = "not expected here: " + CLI::detail::join(unknown, " ");
  }
  return text + "\nRun with --help for more information.\n";
}

/// A wrong value that nobody wrote: names the environment's variable that it came from.
std::string of_environment(const CLI::App& app, const std::string& fault,
                           std::span<const std::string> words) {
  for (const CLI::Option* option : app.get_options()) {
    const std::string& variable = option->get_envname();
    const std::string name = option->get_name();
    const bool is_written =
        std::ranges::any_of(words, [&](const std::string& word) { return word.starts_with(name); });
    if (variable.empty() || is_written || fault.find(name) == std::string::npos) continue;
    if (const char* const value = std::getenv(variable.c_str())) {
      return name + " is taken from the environment's " + variable + "=" + value;
    }
  }
  for (const CLI::App* command : app.get_subcommands()) {
    if (std::string text = of_environment(*command, fault, words); !text.empty()) return text;
  }
  return {};
}

/// Examples stay whole, so that they can be copied.
std::string wrapped(const std::string& text) {
  constexpr std::size_t width = 92;
  std::istringstream lines(text);
  std::string wrapped;
  for (std::string line; std::getline(lines, line);) {
    while (line.size() > width && !line.starts_with(' ')) {
      const std::size_t blank = line.rfind(' ', width);
      if (blank == std::string::npos) break;
      wrapped += line.substr(0, blank) + "\n";
      line.erase(0, blank + 1);
    }
    wrapped += line + "\n";
  }
  if (!wrapped.empty()) wrapped.pop_back();
  return wrapped;
}

}  // namespace

OptionHandle OptionHandle::required() {
  option_->required();
  return *this;
}

OptionHandle OptionHandle::with_default() {
  option_->capture_default_str();
  return *this;
}

OptionHandle OptionHandle::corrected(const std::function<std::string(std::string&)>& correct) {
  option_->transform(CLI::Validator(correct, ""));
  return *this;
}

OptionHandle OptionHandle::one_of(const std::vector<std::string>& values) {
  option_->check(CLI::IsMember(values));
  return *this;
}

OptionHandle OptionHandle::or_empty() {
  option_->get_validator(not_empty)->active(false);
  return *this;
}

OptionHandle OptionHandle::ends_in(const std::string& ending) {
  option_->check([ending](const std::string& word) {
    return word.ends_with(ending) ? std::string() : "'" + word + "' must end in " + ending;
  });
  return *this;
}

OptionHandle OptionHandle::above_zero() {
  constexpr double no_limit = std::numeric_limits<double>::infinity();
  option_->check([](const std::string& word) { return fault_of_positive(word, no_limit); },
                 "POSITIVE");
  return *this;
}

OptionHandle OptionHandle::above_zero_to(int most) {
  option_->check([most](const std::string& word) { return fault_of_positive(word, most); },
                 "above 0 to " + std::to_string(most));
  return *this;
}

OptionHandle OptionHandle::zero_to(int most) {
  option_->check(
      [most](const std::string& word) {
        double value = 0.0;
        const bool is_number = CLI::detail::lexical_cast(word, value) && std::isfinite(value);
        if (is_number && value >= 0.0 && value <= most) return std::string();
        return "'" + word + "' must be a number from 0 to " + std::to_string(most);
      },
      "0 to " + std::to_string(most));
  return *this;
}

OptionHandle OptionHandle::between(int low, int high) {
  option_->check(CLI::Range(low, high));
  return *this;
}

OptionHandle OptionHandle::exactly(int values) {
  option_->expected(values);
  return *this;
}

OptionHandle OptionHandle::up_to(int values) {
  option_->expected(1, values);
  return *this;
}

OptionHandle OptionHandle::comma_separated() {
  option_->delimiter(',');
  return *this;
}

OptionHandle OptionHandle::one_at_a_time() {
  option_->allow_extra_args(false);
  return *this;
}

OptionHandle OptionHandle::from_environment(const std::string& variable) {
  option_->envname(variable);
  return *this;
}

OptionHandle OptionHandle::excludes(const OptionHandle& other) {
  option_->excludes(other.option_);
  return *this;
}

OptionHandle OptionHandle::needs(const OptionHandle& other) {
  option_->needs(other.option_);
  return *this;
}

OptionHandle CommandHandle::option(const std::string& names, std::string& value,
                                   const std::string& help) {
  return OptionHandle(*app_->add_option(names, value, help)->check(fault_of_text, "", not_empty));
}

OptionHandle CommandHandle::option(const std::string& names, double& value,
                                   const std::string& help) {
  return OptionHandle(*app_->add_option(names, value, help));
}

OptionHandle CommandHandle::option(const std::string& names, int& value, const std::string& help) {
  return OptionHandle(*app_->add_option(names, value, help));
}

OptionHandle CommandHandle::option(const std::string& names, std::uint32_t& value,
                                   const std::string& help) {
  return OptionHandle(*app_->add_option(names, value, help)->check(fault_of_unsigned));
}

OptionHandle CommandHandle::option(const std::string& names, std::uint64_t& value,
                                   const std::string& help) {
  return OptionHandle(*app_->add_option(names, value, help)->check(fault_of_unsigned));
}

OptionHandle CommandHandle::option(const std::string& names, std::optional<std::uint64_t>& value,
                                   const std::string& help) {
  return OptionHandle(*app_->add_option(names, value, help)->check(fault_of_unsigned));
}

OptionHandle CommandHandle::option(const std::string& names, std::vector<std::string>& values,
                                   const std::string& help) {
  return OptionHandle(*app_->add_option(names, values, help)->check(fault_of_text, "", not_empty));
}

OptionHandle CommandHandle::option(const std::string& names, std::vector<double>& values,
                                   const std::string& help) {
  return OptionHandle(*app_->add_option(names, values, help));
}

OptionHandle CommandHandle::flag(const std::string& names, bool& value, const std::string& help) {
  return OptionHandle(*app_->add_flag(names, value, help));
}

void CommandHandle::renamed(const std::string& former_name, const std::string& name) {
  app_->add_option_function<std::string>(former_name,
                                         [former_name, name](const std::string&) {
                                           throw CLI::ValidationError(former_name,
                                                                      "is called " + name + " now");
                                         })
      ->group("");  // not in the help
}

void CommandHandle::explain(const std::string& text) { app_->footer(wrapped(text)); }

CommandHandle CommandHandle::command(const std::string& name, const std::string& help) {
  return CommandHandle(*app_->add_subcommand(name, help));
}

void CommandHandle::require_command() { app_->require_subcommand(1); }

void CommandHandle::on_chosen(const std::function<void()>& chosen) { app_->callback(chosen); }

CommandLine::CommandLine(const std::string& program, const std::string& version,
                         const std::string& help)
    : app_(std::make_unique<CLI::App>(help, program)) {
  app_->set_version_flag("--version", version);
  app_->get_formatter()->column_width(36);
  app_->failure_message(describe_fault);
}

CommandLine::~CommandLine() = default;

CommandHandle CommandLine::root() { return CommandHandle(*app_); }

CommandLine::Parsed CommandLine::parse(int argc, char** argv) {
  std::vector<std::string> words(argv, argv + argc);
  for (std::size_t i = 1; i < words.size() && words[i] != "--"; ++i) {
    words[i] = marked_number(words[i]);
  }
  end_lists_of_numbers(*app_, words);
  std::vector<const char*> marked;
  marked.reserve(words.size());
  for (const std::string& word : words) marked.push_back(word.c_str());
  try {
    app_->parse(argc, marked.data());
    return Parsed::command;
  } catch (const CLI::ParseError& error) {
    // Help and version arrive as errors, too, with code 0.
    if (app_->exit(error) == 0) return Parsed::answered;
    const std::span<const std::string> given = std::span(words).subspan(1);
    const std::string name = meant(*app_, given);
    if (!name.empty()) std::cerr << "Did you mean '" << name << "'?\n";
    const std::string origin = of_environment(*app_, error.what(), given);
    if (!origin.empty()) std::cerr << origin << "\n";
    return Parsed::wrong_usage;
  }
}

}  // namespace stillmap::cli
