// The command lines of Graupel's programs: commands, their options, and the values that these may have. CLI11 does the
// work; command_line.cpp alone includes it, as its templates take seconds in every file that does.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/system/command_description.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace graupel {

/// Restricts the values of an option (CommandOption::check); another value is a usage error that names the range.
using ValueCheck = std::function<void(CLI::Option&)>;

/// A whole number from `low` to `high`.
ValueCheck whole_number(int64_t low, int64_t high = std::numeric_limits<int64_t>::max());

/// What a real number may be at least.
enum class LowerBound { zero, above_zero };
/// A finite number.
ValueCheck real_number(LowerBound bound);
/// A number from `low` to `high`.
ValueCheck real_number(double low, double high);

/// One of these words, which --help lists.
ValueCheck one_of(const std::vector<std::string>& words);
/// A number from `low` to `high`, a range that --help tells.
ValueCheck shown_range(int64_t low, int64_t high);
ValueCheck shown_range(double low, double high);

/// An option of a command. The Command owns it; copies are of the same one.
class CommandOption {
 public:
  explicit CommandOption(CLI::Option* option) : option_(option) {}

  CommandOption check(const ValueCheck& check) const;
  CommandOption required() const;
  /// --help tells the value that the variable has now.
  CommandOption show_default() const;
  /// --help tells this instead.
  CommandOption show_default(const std::string& text) const;
  /// Several values in one word, apart by this character.
  CommandOption delimiter(char character) const;
  /// One value each time that the option is given.
  CommandOption one_value_each() const;
  /// Of a list: all values of all times that the option is given.
  CommandOption take_all() const;
  CommandOption values(int count) const;
  /// Its value names a file with one of these endings (".h5"; none: any file) or a folder. Shells offer them; it must
  /// not be empty, and nothing else is checked.
  CommandOption names_file(const std::vector<std::string>& endings = {}) const;
  CommandOption names_folder() const;
  /// Words that shells offer beside others that are allowed too.
  CommandOption suggest(const std::vector<std::string>& words) const;
  /// Sets `given` where the user gives the option.
  CommandOption remember_in(bool& given) const;
  /// May be given only together with `other`, or never with the option of that name.
  CommandOption needs(const CommandOption& other) const;
  CommandOption excludes(const std::string& name) const;

 private:
  CLI::Option* option_;
};

/// A command of a program with its options, whose variables must outlive the parsing. Copies are of the same command.
class Command {
 public:
  Command command(const std::string& name, const std::string& description) const;
  /// One command must be named.
  void require_command() const;

  CommandOption option(const std::string& name, std::string& value, const std::string& text) const;
  CommandOption option(const std::string& name, int& value, const std::string& text) const;
  CommandOption option(const std::string& name, int64_t& value, const std::string& text) const;
  CommandOption option(const std::string& name, uint64_t& value, const std::string& text) const;
  CommandOption option(const std::string& name, double& value, const std::string& text) const;
  CommandOption option(const std::string& name, std::optional<int>& value, const std::string& text) const;
  CommandOption option(const std::string& name, std::optional<int64_t>& value, const std::string& text) const;
  CommandOption option(const std::string& name, std::optional<double>& value, const std::string& text) const;
  CommandOption option(const std::string& name, std::vector<std::string>& value, const std::string& text) const;
  CommandOption option(const std::string& name, std::vector<int64_t>& value, const std::string& text) const;
  CommandOption option(const std::string& name, std::vector<double>& value, const std::string& text) const;
  /// Sets `value`; a name that begins with '!' clears it.
  CommandOption flag(const std::string& name, bool& value, const std::string& text) const;

  /// Text below the options in --help.
  void footer(const std::string& text) const;
  /// All words after the command's name are words(), --help among them.
  void take_words_as_they_are() const;
  std::vector<std::string> words() const;
  /// What --help knows of it and of its commands.
  CommandDescription description() const;
  /// What the command does, once all is parsed.
  void callback(std::function<void()> work) const;

 protected:
  explicit Command(CLI::App* app) : app_(app) {}
  CLI::App* app_;
};

/// A program: the command that the others belong to.
class CommandLine : public Command {
 public:
  explicit CommandLine(const std::string& description, const std::string& name = "");
  ~CommandLine();
  CommandLine(const CommandLine&) = delete;
  CommandLine& operator=(const CommandLine&) = delete;

  /// What --version prints.
  void version(const std::string& text) const;
  /// Parses and runs the named command. Returns 0; after --help and --version, which are printed, 0 too; and
  /// ExitCode::usage after a mistake, which is printed under `program`'s name with the closest word that is known.
  int run(int argc, const char* const* argv, const std::string& program) const;
  /// Parses words inside another program's callback. A mistake, and --help, are thrown to its run().
  void parse(std::vector<std::string> words) const;

 private:
  std::unique_ptr<CLI::App> owned_;
};

}  // namespace graupel
