// fish: a line for each command, option and word, with the condition that the words so far lead to it.
#include <fmt/format.h>

#include "experiments/manual/command_tree.h"
#include "experiments/manual/shell_completion.h"

namespace graupel::experiments {

namespace {

constexpr const char* functions =
    R"(# Completion of @name@ in fish, for a folder of $fish_complete_path. Made by '@name@ completion fish'.

function __@name@_at --description 'Whether the words lead to this command, with so many words (-1: any) behind it'
    set -l words (commandline -opc)
    set -l path @name@
    set -l option ''
    set -l count 0
    for word in $words[2..]
        if test -n "$option"
            switch $option
                case @many@
                    string match -q -- '-*' $word; or continue
                    set option ''
                case '*'
                    set option ''
                    continue
            end
        end
        switch "$path $word"
            case @commands@
                set path "$path $word"
                set count 0
            case @valued@
                set option "$path $word"
            case '* -*'
            case '*'
                set count (math $count + 1)
        end
    end
    test "$path" = $argv[1]; and test $argv[2] = -1 -o $argv[2] = $count
end

function __@name@_value --description 'The value that is typed: what follows --option='
    string replace -r -- '^--[a-z0-9-]+=' '' (commandline -ct)
end

function __@name@_words --description 'Words, behind the values of a list (DELIMITER WORD...)'
    set -l before ''
    test -n "$argv[1]"; and set before (string replace -r -- '[^'$argv[1]']*$' '' (__@name@_value))
    for word in $argv[2..]
        echo $before$word
    end
end

function __@name@_files --description 'Files with these endings (none: all) and folders (DELIMITER ENDING...)'
    set -l before ''
    set -l name (__@name@_value)
    if test -n "$argv[1]"
        set before (string replace -r -- '[^'$argv[1]']*$' '' $name)
        set name (string replace -r -- '^.*'$argv[1] '' $name)
    end
    for file in (complete -C "__@name@_no_command $name")
        string match -q -- '*:*' $file; and not test -e $file; and continue # fish took what stands behind a colon
        if test (count $argv) = 1; or string match -q -- '*/' $file
            echo $before$file
            continue
        end
        for ending in $argv[2..]
            string match -q -- "*$ending" $file; and echo $before$file
        end
    end
end

complete -c @name@ -f
)";

std::string fish_quoted(const std::string& text) {
  return "'" + replaced(replaced(replaced(text, "\\", "\\\\"), "'", "\\'"), "\n", " ") + "'";
}

std::string quoted_words(const std::vector<std::string>& words) {
  std::string all;
  for (const std::string& word : words) all += (all.empty() ? "" : " ") + fish_quoted(word);
  return all.empty() ? "''" : all;
}

/// Calls of the functions above that offer a value; "" where nothing is known of it.
std::string offer(const std::string& name, const OptionDescription& option) {
  std::vector<std::string> words = option.choices;
  words.insert(words.end(), option.suggestions.begin(), option.suggestions.end());
  std::string calls;
  const std::string delimiter = " " + fish_quoted(option.delimiter);
  if (!words.empty()) calls += fmt::format("(__{}_words{} {})", name, delimiter, quoted_words(words));
  if (option.names_file || option.names_folder) {
    // A name that ends so is a folder's.
    std::vector<std::string> endings = option.file_endings;
    if (!option.names_file) endings = {"/"};
    calls += fmt::format("{}(__{}_files{}{})", calls.empty() ? "" : " ", name, delimiter,
                         endings.empty() ? "" : " " + quoted_words(endings));
  }
  return calls.empty() ? "" : " -a " + fish_quoted(calls);
}

std::string condition(const std::string& name, const std::string& command, int words) {
  return "-n " + fish_quoted(fmt::format("__{}_at {} {}", name, fish_quoted(command), words));
}

std::string lines_of(const CommandPath& path, const std::string& name) {
  const std::string front = "complete -c " + name + " ", command = path.joined(" ");
  std::string lines = "\n";
  for (const CommandDescription& other : path.command->commands)
    lines += front + condition(name, command, 0) + " -a " + fish_quoted(other.name) + " -d " + fish_quoted(other.text) +
             "\n";
  int place = 0;
  for (const OptionDescription& option : path.command->options) {
    std::string flags;
    for (const std::string& flag : option.flags)
      flags += flag.starts_with("--") ? " -l " + flag.substr(2) : " -s " + flag.substr(1);
    if (!flags.empty()) {
      const std::string value = option.value.empty() ? "" : " -x" + offer(name, option);
      lines += front + condition(name, command, -1) + flags + " -d " + fish_quoted(option.text) + value + "\n";
    }
    if (option.word.empty()) continue;
    const std::string offered = offer(name, option);
    if (!offered.empty()) lines += front + condition(name, command, option.many ? -1 : place) + offered + "\n";
    ++place;
  }
  return lines;
}

}  // namespace

std::string fish_completion(const CommandDescription& program) {
  std::vector<std::string> commands, valued, many;
  std::string lines;
  for (const CommandPath& path : command_tree(program)) {
    const std::string command = path.joined(" ");
    if (path.words.size() > 1) commands.push_back(command);
    for (const OptionDescription& option : path.command->options)
      for (const std::string& flag : option.flags) {
        if (!option.value.empty()) valued.push_back(command + " " + flag);
        if (option.many) many.push_back(command + " " + flag);
      }
    lines += lines_of(path, program.name);
  }
  std::string text = functions;
  text = replaced(text, "@commands@", quoted_words(commands));
  text = replaced(text, "@valued@", quoted_words(valued));
  text = replaced(text, "@many@", quoted_words(many));
  return replaced(text, "@name@", program.name) + lines;
}

}  // namespace graupel::experiments
