// zsh: a function for each command, which hands its options and words to _arguments.
#include <fmt/format.h>

#include "experiments/manual/command_tree.h"
#include "experiments/manual/shell_completion.h"

namespace graupel::experiments {

namespace {

/// In single quotes.
std::string zsh_quoted(const std::string& text) { return "'" + replaced(text, "'", "'\\''") + "'"; }

/// Text inside [...] of _arguments, and where a colon ends it.
std::string plain(std::string text) {
  for (const char* special : {"\\", "[", "]", ":"}) text = replaced(text, special, std::string("\\") + special);
  return replaced(text, "\n", " ");
}

std::string words_action(const std::vector<std::string>& words) {
  std::string list;
  for (const std::string& word : words) list += (list.empty() ? "" : " ") + plain(word);
  return "(" + list + ")";
}

std::string files_action(const OptionDescription& option) {
  if (!option.names_file) return "_files -/";
  std::string endings;
  for (const std::string& ending : option.file_endings) endings += (endings.empty() ? "" : "|") + ending.substr(1);
  if (option.file_endings.size() > 1) endings = "(" + endings + ")";  // of one zsh would make a qualifier
  return endings.empty() ? "_files" : "_files -g \"*." + endings + "\"";
}

/// What _arguments does for a value; a blank where nothing is known of it.
std::string action(const OptionDescription& option, const std::string& list_function) {
  std::vector<std::string> words = option.choices;
  words.insert(words.end(), option.suggestions.begin(), option.suggestions.end());
  const bool files = option.names_file || option.names_folder;
  if (!option.delimiter.empty() && (files || !words.empty()))
    return "_sequence -s " + option.delimiter + " " + list_function;
  if (files && !words.empty()) return "{" + list_function + "}";
  if (files) return files_action(option);
  return words.empty() ? " " : words_action(words);
}

/// A function that offers words and files, for values that are either.
std::string list_function(const OptionDescription& option, const std::string& name) {
  std::vector<std::string> words = option.choices;
  words.insert(words.end(), option.suggestions.begin(), option.suggestions.end());
  std::string body;
  if (!words.empty()) body += " " + zsh_quoted("words:value:" + words_action(words));
  if (option.names_file || option.names_folder) body += " " + zsh_quoted("files:file:" + files_action(option));
  return body.empty() ? "" : name + "() {\n  _alternative" + body + "\n}\n\n";
}

/// '(-o --output)'{-o,--output=}'[text]:FILE:_files'
std::string option_line(const OptionDescription& option, const std::string& list) {
  std::string names, all;
  for (const std::string& flag : option.flags) {
    names += (names.empty() ? "" : ",") + flag + (flag.starts_with("--") && !option.value.empty() ? "=" : "");
    all += (all.empty() ? "" : " ") + flag;
  }
  const bool several = option.flags.size() > 1;
  std::string value;
  if (!option.value.empty()) value = ":" + plain(option.value) + ":" + action(option, list);
  const std::string front = option.repeats ? "*" : several ? "(" + all + ")" : "";
  const std::string rest = "[" + plain(option.text) + "]" + value;
  return several ? zsh_quoted(front) + "{" + names + "}" + zsh_quoted(rest) : zsh_quoted(front + names + rest);
}

std::string word_line(const OptionDescription& option, const std::string& list) {
  const std::string front = option.many ? "*:" : option.required ? ":" : "::";
  return zsh_quoted(front + plain(option.word) + ":" + action(option, list));
}

std::string function_of(const CommandPath& path) {
  const std::string name = "_" + path.joined("_");
  std::string helpers, lines;
  const auto add = [&lines](const std::string& line) { lines += " \\\n    " + line; };
  for (const OptionDescription& option : path.command->options) {
    const std::string key = option.flags.empty() ? option.word : option.flags.back().substr(2);
    const std::string list = name + "_" + replaced(key, "-", "_");
    const bool files = option.names_file || option.names_folder;
    if (!option.delimiter.empty() || (files && !(option.choices.empty() && option.suggestions.empty())))
      helpers += list_function(option, list);
    if (!option.flags.empty()) add(option_line(option, list));
    if (!option.word.empty()) add(word_line(option, list));
  }
  if (path.command->commands.empty()) return helpers + name + "() {\n  _arguments -s -S" + lines + "\n}\n\n";

  std::string commands, cases;
  for (const CommandDescription& other : path.command->commands) {
    commands += "    " + zsh_quoted(replaced(other.name, ":", "\\:") + ":" + replaced(other.text, "\n", " ")) + "\n";
    cases += fmt::format("    {}) {}_{} ;;\n", other.name, name, other.name);
  }
  add("':command:->command'");
  add("'*::word:->words'");
  return helpers + name + "() {\n  local curcontext=$curcontext state line\n  local -a commands=(\n" + commands +
         "  )\n  _arguments -C" + lines + " && return\n  case $state in\n    command) _describe command commands ;;\n" +
         "    words)\n      curcontext=${curcontext%:*}-$line[1]:\n      case $line[1] in\n" + cases +
         "      esac ;;\n  esac\n}\n\n";
}

}  // namespace

std::string zsh_completion(const CommandDescription& program) {
  std::string text = fmt::format(
      "#compdef {0}\n# Completion of {0} in zsh, for a folder of $fpath under the name _{0}. Made by '{0} completion "
      "zsh'.\n\n",
      program.name);
  for (const CommandPath& path : command_tree(program)) text += function_of(path);
  return text + fmt::format("if [ \"$funcstack[1]\" = _{0} ]; then\n  _{0} \"$@\"\nelse\n  compdef _{0} {0}\nfi\n",
                            program.name);
}

}  // namespace graupel::experiments
