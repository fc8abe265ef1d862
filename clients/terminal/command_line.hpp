#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace stillmap::cli {

// CLI11 is a large header: behind these handles it is compiled once instead of in every command.

/// Refines an option that was added to a command. Values outside its limits are wrong usage.
class OptionHandle {
 public:
  explicit OptionHandle(CLI::Option& option) : option_(&option) {}

  OptionHandle required();
  /// The help shows the value that the variable has now.
  OptionHandle with_default();
  /// `correct` makes the value that is meant of the word; what it returns is wrong usage, unless
  /// empty.
  OptionHandle corrected(const std::function<std::string(std::string&)>& correct);
  OptionHandle one_of(const std::vector<std::string>& values);
  /// A text may be empty, which says something here. Elsewhere nobody means that: it is what an
  /// unset variable of a script leaves.
  OptionHandle or_empty();
  /// The name of a file with this ending, as ".png".
  OptionHandle ends_in(const std::string& ending);
  OptionHandle above_zero();
  /// Above zero, and so much at most, which the help shows.
  OptionHandle above_zero_to(int most);
  OptionHandle zero_to(int most);
  OptionHandle between(int low, int high);
  /// A list of exactly so many values.
  OptionHandle exactly(int values);
  /// A list of one value or more, at most so many.
  OptionHandle up_to(int values);
  /// A list may be written as one word: a,b,c.
  OptionHandle comma_separated();
  /// Each value of a list has the option's name before it: words that follow are no values of it.
  OptionHandle one_at_a_time();
  /// The environment variable that gives the value when the option is absent.
  OptionHandle from_environment(const std::string& variable);
  /// Both cannot be given.
  OptionHandle excludes(const OptionHandle& other);
  /// It says nothing without the other, and cannot be given alone.
  OptionHandle needs(const OptionHandle& other);

 private:
  CLI::Option* option_;
};

/// A command and its options. Variables must outlive the command line.
class CommandHandle {
 public:
  explicit CommandHandle(CLI::App& app) : app_(&app) {}

  /// `names` as "--count,-c", or "NAME" for a value by its place, or both: "NAME,--name". A value
  /// by its place may come after a list of numbers.
  OptionHandle option(const std::string& names, std::string& value, const std::string& help);
  OptionHandle option(const std::string& names, double& value, const std::string& help);
  OptionHandle option(const std::string& names, int& value, const std::string& help);
  /// A negative number is wrong usage.
  OptionHandle option(const std::string& names, std::uint32_t& value, const std::string& help);
  OptionHandle option(const std::string& names, std::uint64_t& value, const std::string& help);
  /// Nothing where it is not given: every number has a meaning.
  OptionHandle option(const std::string& names, std::optional<std::uint64_t>& value,
                      const std::string& help);
  OptionHandle option(const std::string& names, std::vector<std::string>& values,
                      const std::string& help);
  OptionHandle option(const std::string& names, std::vector<double>& values,
                      const std::string& help);
  /// "--labels,!--no-labels" has a name for each state.
  OptionHandle flag(const std::string& names, bool& value, const std::string& help);
  /// Makes an option's former name, with a value, wrong usage that names the new one.
  void renamed(const std::string& former_name, const std::string& name);

  /// Text under the options. Lines that begin with a blank are examples and stay as they are;
  /// others are wrapped.
  void explain(const std::string& text);
  CommandHandle command(const std::string& name, const std::string& help);
  /// One of the commands below it must be named.
  void require_command();
  /// Called when this command was named.
  void on_chosen(const std::function<void()>& chosen);

 private:
  CLI::App* app_;
};

/// The command line of a program.
class CommandLine {
 public:
  CommandLine(const std::string& program, const std::string& version, const std::string& help);
  ~CommandLine();

  [[nodiscard]] CommandHandle root();

  enum class Parsed {
    /// A command was chosen.
    command,
    /// Help or version was printed.
    answered,
    /// What is wrong was printed.
    wrong_usage,
  };
  [[nodiscard]] Parsed parse(int argc, char** argv);

 private:
  std::unique_ptr<CLI::App> app_;
};

}  // namespace stillmap::cli
