#include "core/system/command_line.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <utility>

#include "core/system/edit_distance.h"
#include "core/system/error.h"

namespace graupel {

namespace {

/// A check of the whole text as a number of type T; `range` says what is allowed.
template <typename T, typename Allowed>
ValueCheck number_check(Allowed allowed, std::string range) {
  const auto test = [allowed, range = std::move(range)](std::string& text) -> std::string {
    T value = 0;
    const char* const end = text.data() + text.size();
    const auto [stop, error] = std::from_chars(text.data(), end, value);
    if (error == std::errc() && stop == end && allowed(value)) return "";
    return "'" + text + "' is not usable (allowed: " + range + ")";
  };
  return [test](CLI::Option& option) { option.check(CLI::Validator(test, "")); };
}

/// CLI11's message, with the closest command or flag for each mistyped one.
std::string parse_error_text(const CLI::App& app, const CLI::ParseError& error) {
  std::string text = error.what();
  const CLI::App* verb = app.get_subcommands().empty() ? &app : app.get_subcommands().front();
  std::vector<std::string> known;
  for (const CLI::App* word : verb->get_subcommands({})) known.push_back(word->get_name());
  const std::vector<std::string> left = app.remaining();
  if (verb == &app && app.get_require_subcommand_min() > 0 && !left.empty())
    text = "'" + left.front() + "' is not a command" +
           (left.front().starts_with('-') ? ", and flags come after one" : "") +
           " (allowed: " + CLI::detail::join(known, ", ") + ")";
  for (const CLI::Option* option : verb->get_options())
    for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
  for (const std::string& word : verb->remaining(true)) {
    if (word == "--") text += ". Words after '--' are no flags: put flags before it";
    if (word.find_first_not_of('-') == std::string::npos) continue;
    const std::string close = closest_of(word.substr(0, word.find('=')), known);
    if (!close.empty()) text += ". Did you mean '" + close + "' instead of '" + word + "'?";
  }
  return text;
}

/// CLI11 takes "--" after a command with words of its own for its own: it is hidden from it meanwhile.
const std::string hidden_dashes = "\x1d--";

/// Last word first, as CLI11 takes them.
std::vector<std::string> reversed_words(const CLI::App& app, int argc, const char* const* argv) {
  std::vector<std::string> words(argv + std::min(1, argc), argv + argc);
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    if (!words.empty() && command->get_name() == words.front() && command->get_prefix_command())
      std::replace(words.begin(), words.end(), std::string("--"), hidden_dashes);
  std::reverse(words.begin(), words.end());
  return words;
}

/// CLI11 has no place for what shells may offer: it is the name of a check that allows everything.
constexpr const char *file_hint = "file:", *folder_hint = "folder:", *word_hint = "words:", *choice_hint = "choices:";

std::string joined(const std::vector<std::string>& words) {
  std::string all;
  for (const std::string& word : words) all += (all.empty() ? "" : "\n") + word;
  return all;
}

void add_hint(CLI::Option& option, const char* kind, const std::vector<std::string>& words) {
  option.check(CLI::Validator([](std::string&) { return std::string(); }, "", kind + joined(words)));
}

/// An empty name would be that of the default, or of none.
void refuse_empty(CLI::Option& option) {
  option.check(CLI::Validator(
      [](std::string& text) {
        return text.empty() ? std::string("is empty (allowed: the name of a file or folder). Give one, or leave it out")
                            : std::string();
      },
      ""));
}

/// What follows `kind` in the names of the option's checks, one text for each.
std::vector<std::string> hints_of(CLI::Option& option, const std::string& kind) {
  std::vector<std::string> hints;
  for (int i = 0;; ++i) {
    try {
      const std::string name = option.get_validator(i)->get_name();
      if (name.starts_with(kind)) hints.push_back(name.substr(kind.size()));
    } catch (const CLI::OptionNotFound&) {  // no further check
      return hints;
    }
  }
}

std::vector<std::string> words_of(CLI::Option& option, const std::string& kind) {
  std::vector<std::string> words;
  for (const std::string& hint : hints_of(option, kind))
    for (const std::string& word : CLI::detail::split(hint, '\n'))
      if (!word.empty()) words.push_back(word);
  return words;
}

OptionDescription describe(CLI::Option& option) {
  OptionDescription known;
  for (const std::string& name : option.get_snames()) known.flags.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) known.flags.push_back("--" + name);
  if (option.get_positional()) known.word = option.get_name(true);
  const std::string type = option.get_type_name();
  if (option.get_items_expected_max() > 0) known.value = type.substr(0, type.find(':'));
  known.text = option.get_description();
  known.default_value = option.get_default_str();
  known.choices = words_of(option, choice_hint);
  known.suggestions = words_of(option, word_hint);
  known.file_endings = words_of(option, file_hint);
  known.names_file = !hints_of(option, file_hint).empty();
  known.names_folder = !hints_of(option, folder_hint).empty();
  known.required = option.get_required();
  known.repeats = option.get_expected_max() > 1;
  known.many = known.repeats && option.get_allow_extra_args();
  if (option.get_delimiter() != '\0') known.delimiter = std::string(1, option.get_delimiter());
  return known;
}

CommandDescription describe(CLI::App& app) {
  CommandDescription known{app.get_name(), app.get_description(), app.get_footer(), {}, {}};
  for (CLI::Option* option : app.get_options()) known.options.push_back(describe(*option));
  for (CLI::App* command : app.get_subcommands({})) known.commands.push_back(describe(*command));
  return known;
}

}  // namespace

ValueCheck whole_number(int64_t low, int64_t high) {
  const bool open = high == std::numeric_limits<int64_t>::max();
  return number_check<int64_t>(
      [low, high](int64_t value) { return value >= low && value <= high; },
      "a whole number, " + std::to_string(low) + (open ? " or more" : " to " + std::to_string(high)));
}

ValueCheck real_number(LowerBound bound) {
  return number_check<double>(
      [bound](double value) { return std::isfinite(value) && (bound == LowerBound::zero ? value >= 0 : value > 0); },
      std::string("a number") + (bound == LowerBound::zero ? ", 0 or more" : " above 0"));
}

ValueCheck real_number(double low, double high) {
  return number_check<double>([low, high](double value) { return value >= low && value <= high; },
                              "a number, " + CLI::detail::to_string(low) + " to " + CLI::detail::to_string(high));
}

ValueCheck one_of(const std::vector<std::string>& words) {
  return [words](CLI::Option& option) { option.check(CLI::IsMember(words).name(choice_hint + joined(words))); };
}

ValueCheck shown_range(int64_t low, int64_t high) {
  return [low, high](CLI::Option& option) { option.check(CLI::Range(low, high)); };
}

ValueCheck shown_range(double low, double high) {
  return [low, high](CLI::Option& option) { option.check(CLI::Range(low, high)); };
}

CommandOption CommandOption::check(const ValueCheck& check) const {
  check(*option_);
  return *this;
}

CommandOption CommandOption::required() const {
  option_->required();
  return *this;
}

CommandOption CommandOption::show_default() const {
  option_->capture_default_str();
  return *this;
}

CommandOption CommandOption::show_default(const std::string& text) const {
  option_->default_str(text);
  return *this;
}

CommandOption CommandOption::delimiter(char character) const {
  option_->delimiter(character);
  return *this;
}

CommandOption CommandOption::one_value_each() const {
  option_->allow_extra_args(false);
  return *this;
}

CommandOption CommandOption::take_all() const {
  option_->take_all();
  return *this;
}

CommandOption CommandOption::values(int count) const {
  option_->expected(count);
  return *this;
}

CommandOption CommandOption::names_file(const std::vector<std::string>& endings) const {
  refuse_empty(*option_);
  add_hint(*option_, file_hint, endings);
  return *this;
}

CommandOption CommandOption::names_folder() const {
  refuse_empty(*option_);
  add_hint(*option_, folder_hint, {});
  return *this;
}

CommandOption CommandOption::suggest(const std::vector<std::string>& words) const {
  add_hint(*option_, word_hint, words);
  return *this;
}

CommandOption CommandOption::remember_in(bool& given) const {
  option_->each([&given](const std::string&) { given = true; });
  return *this;
}

CommandOption CommandOption::needs(const CommandOption& other) const {
  option_->needs(other.option_);
  return *this;
}

CommandOption CommandOption::excludes(const std::string& name) const {
  option_->excludes(name);
  return *this;
}

Command Command::command(const std::string& name, const std::string& description) const {
  return Command(app_->add_subcommand(name, description));
}

void Command::require_command() const { app_->require_subcommand(1); }

CommandOption Command::option(const std::string& name, std::string& value, const std::string& text) const {
  return CommandOption(app_->add_option(name, value, text));
}

CommandOption Command::option(const std::string& name, int& value, const std::string& text) const {
  return CommandOption(app_->add_option(name, value, text));
}

CommandOption Command::option(const std::string& name, int64_t& value, const std::string& text) const {
  return CommandOption(app_->add_option(name, value, text));
}

/// CLI11 takes -1 for the largest number, and larger ones for it too.
CommandOption Command::option(const std::string& name, uint64_t& value, const std::string& text) const {
  const ValueCheck whole = number_check<uint64_t>([](uint64_t) { return true; }, "a whole number, 0 to 2^64 - 1");
  return CommandOption(app_->add_option(name, value, text)).check(whole);
}

CommandOption Command::option(const std::string& name, double& value, const std::string& text) const {
  return CommandOption(app_->add_option(name, value, text));
}

CommandOption Command::option(const std::string& name, std::optional<int>& value, const std::string& text) const {
  return CommandOption(app_->add_option(name, value, text));
}

CommandOption Command::option(const std::string& name, std::optional<int64_t>& value, const std::string& text) const {
  return CommandOption(app_->add_option(name, value, text));
}

CommandOption Command::option(const std::string& name, std::optional<double>& value, const std::string& text) const {
  return CommandOption(app_->add_option(name, value, text));
}

CommandOption Command::option(const std::string& name, std::vector<std::string>& value, const std::string& text) const {
  return CommandOption(app_->add_option(name, value, text));
}

CommandOption Command::option(const std::string& name, std::vector<int64_t>& value, const std::string& text) const {
  return CommandOption(app_->add_option(name, value, text));
}

CommandOption Command::option(const std::string& name, std::vector<double>& value, const std::string& text) const {
  return CommandOption(app_->add_option(name, value, text));
}

CommandOption Command::flag(const std::string& name, bool& value, const std::string& text) const {
  return CommandOption(app_->add_flag(name, value, text));
}

void Command::footer(const std::string& text) const { app_->footer(text); }

void Command::take_words_as_they_are() const {
  app_->prefix_command();
  app_->set_help_flag();
}

std::vector<std::string> Command::words() const {
  std::vector<std::string> words = app_->remaining();
  std::replace(words.begin(), words.end(), hidden_dashes, std::string("--"));
  return words;
}

CommandDescription Command::description() const { return describe(*app_); }

void Command::callback(std::function<void()> work) const { app_->callback(std::move(work)); }

CommandLine::CommandLine(const std::string& description, const std::string& name)
    : Command(nullptr), owned_(std::make_unique<CLI::App>(description, name)) {
  app_ = owned_.get();
}

CommandLine::~CommandLine() = default;

void CommandLine::version(const std::string& text) const { app_->set_version_flag("--version", text); }

int CommandLine::run(int argc, const char* const* argv, const std::string& program) const {
  try {
    if (app_->get_name().empty() && argc > 0) app_->name(argv[0]);
    app_->parse(reversed_words(*app_, argc, argv));
    return static_cast<int>(ExitCode::ok);
  } catch (const CLI::Success& help) {
    return app_->exit(help);
  } catch (const CLI::ParseError& error) {
    const auto named = app_->get_subcommands();
    std::fprintf(stderr, "%s: %s\nRun '%s%s --help' for the flags.\n", program.c_str(),
                 parse_error_text(*app_, error).c_str(), program.c_str(),
                 named.empty() ? "" : (" " + named.front()->get_name()).c_str());
    return static_cast<int>(ExitCode::usage);
  }
}

void CommandLine::parse(std::vector<std::string> words) const {
  std::reverse(words.begin(), words.end());
  app_->parse(words);
}

}  // namespace graupel
