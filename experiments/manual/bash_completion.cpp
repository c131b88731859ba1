// bash: one function walks over the words before the cursor by tables of commands and options, and offers what fits.
#include <fmt/format.h>

#include "core/system/shell_words.h"
#include "experiments/manual/command_tree.h"
#include "experiments/manual/shell_completion.h"

namespace graupel::experiments {

namespace {

// @name@ is the program's name, @...@ are tables.
constexpr const char* script =
    R"(# Completion of @name@ in bash; 'source' it, or put it where bash-completion looks. Made by '@name@ completion bash'.

_@name@_words() { # WORD...: those that begin with $cur
  local word
  for word; do [[ $word != "$cur"* ]] || COMPREPLY+=("$before$word"); done
}

_@name@_files() { # ENDING...: files that begin with $cur and end so (none: all), and folders
  local ending name
  [[ -n $before ]] || compopt -o filenames 2> /dev/null
  while IFS= read -r name; do
    [[ -z $before || ! -d $name ]] || name+=/
    COMPREPLY+=("$before$name")
  done < <(
    if (($#)); then compgen -d -- "$cur"; else compgen -f -- "$cur"; fi
    for ending; do compgen -f -X "!*$ending" -- "$cur"; done
  )
}

_@name@_folders() {
  compopt -o filenames 2> /dev/null
  local name
  while IFS= read -r name; do COMPREPLY+=("$before$name"); done < <(compgen -d -- "$cur")
}

_@name@_list() { # DELIMITER: $cur is the last of a list's values, $before the others
  compopt -o nospace 2> /dev/null
  before=${cur%"${cur##*"$1"}"}
  cur=${cur##*"$1"}
}

_@name@() {
  COMPREPLY=()
  # Words as the program sees them: readline breaks them at = and :.
  local -a words=()
  local i piece line=${COMP_LINE:0:COMP_POINT}
  for ((i = 0; i <= COMP_CWORD; i++)); do
    piece=${COMP_WORDS[i]}
    if ((i > 1)) && [[ $piece =~ ^[=:]+$ || ${words[-1]} == *[=:] && $piece != -* &&
      ! ($i == "$COMP_CWORD" && -z $piece && $line == *[[:blank:]]) ]]; then
      words[-1]+=$piece
    else
      words+=("$piece")
    fi
  done

  # The command so far, the option whose value comes next, the number of words without a flag.
  local cur=${words[-1]} before= path=@name@ option= count=0 word
  for word in "${words[@]:1:${#words[@]}-2}"; do
    if [[ -n $option ]]; then
      case $option in
        @many@) [[ $word == -* ]] || continue ;; # all words up to the next option are its values
        *) option= && continue ;;
      esac
      option=
    fi
    case "$path $word" in
      @commands@) path+=" $word" count=0 ;;
      @valued@) option="$path $word" ;;
      *) [[ $word == -* ]] || ((++count)) ;;
    esac
  done
  if [[ $cur == --*=* ]]; then
    option="$path ${cur%%=*}"
    cur=${cur#*=}
  fi
  local whole=$cur
  cur=${cur#[\"\']}
  cur=${cur//\\/}

  if [[ $cur == -* ]]; then
    case $path in
@options@    esac
  elif [[ -n $option ]]; then
    case $option in
@values@    esac
  else
    case "$path $count" in
@positions@    esac
  fi

  # readline replaces what stands behind the last colon.
  if [[ $whole == *:* && $COMP_WORDBREAKS == *:* ]]; then
    COMPREPLY=("${COMPREPLY[@]#"${whole%"${whole##*:}"}"}")
  fi
}

complete -F _@name@ @name@
)";

/// Patterns of a case, which never match where there are none.
std::string patterns(const std::vector<std::string>& words) {
  std::string all;
  for (const std::string& word : words) all += (all.empty() ? "" : " | ") + ("\"" + word + "\"");
  return all.empty() ? "\"\"" : all;
}

/// Calls that offer the values of an option or word; "" where nothing is known of them.
std::string offer(const std::string& name, const OptionDescription& option) {
  std::string calls;
  if (!option.delimiter.empty()) calls += fmt::format("_{}_list {}; ", name, shell_word(option.delimiter));
  std::vector<std::string> words = option.choices;
  words.insert(words.end(), option.suggestions.begin(), option.suggestions.end());
  if (!words.empty()) calls += fmt::format("_{}_words {}; ", name, shell_line(words));
  if (option.names_file)
    calls +=
        fmt::format("_{}_files{}{}; ", name, option.file_endings.empty() ? "" : " ", shell_line(option.file_endings));
  else if (option.names_folder)
    calls += fmt::format("_{}_folders; ", name);
  return calls;
}

struct Tables {
  std::vector<std::string> commands, valued, many;
  std::string values, options, positions;
};

void add_positions(const std::string& name, const CommandPath& path, Tables& tables) {
  const std::string command = path.joined(" ");
  if (!path.command->commands.empty()) {
    std::vector<std::string> verbs;
    for (const CommandDescription& other : path.command->commands) verbs.push_back(other.name);
    tables.positions += fmt::format("      \"{} 0\") _{}_words {} ;;\n", command, name, shell_line(verbs));
  }
  int place = 0;
  for (const OptionDescription& option : path.command->options) {
    if (option.word.empty()) continue;
    const std::string calls = offer(name, option);
    const std::string which = option.many ? "\"" + command + " \"*" : fmt::format("\"{} {}\"", command, place++);
    if (!calls.empty()) tables.positions += fmt::format("      {}) {};;\n", which, calls);
  }
}

Tables tables_of(const CommandDescription& program) {
  Tables tables;
  for (const CommandPath& path : command_tree(program)) {
    const std::string command = path.joined(" ");
    if (path.words.size() > 1) tables.commands.push_back(command);
    std::vector<std::string> flags;
    for (const OptionDescription& option : path.command->options) {
      flags.insert(flags.end(), option.flags.begin(), option.flags.end());
      if (option.value.empty()) continue;
      std::vector<std::string> named;
      for (const std::string& flag : option.flags) named.push_back(command + " " + flag);
      tables.valued.insert(tables.valued.end(), named.begin(), named.end());
      if (option.many) tables.many.insert(tables.many.end(), named.begin(), named.end());
      const std::string calls = named.empty() ? "" : offer(program.name, option);
      if (!calls.empty()) tables.values += fmt::format("      {}) {};;\n", patterns(named), calls);
    }
    tables.options += fmt::format("      \"{}\") _{}_words {} ;;\n", command, program.name, shell_line(flags));
    add_positions(program.name, path, tables);
  }
  return tables;
}

}  // namespace

std::string bash_completion(const CommandDescription& program) {
  const Tables tables = tables_of(program);
  std::string text = script;
  text = replaced(text, "@many@", patterns(tables.many));
  text = replaced(text, "@commands@", patterns(tables.commands));
  text = replaced(text, "@valued@", patterns(tables.valued));
  text = replaced(text, "@values@", tables.values);
  text = replaced(text, "@options@", tables.options);
  text = replaced(text, "@positions@", tables.positions);
  return replaced(text, "@name@", program.name);
}

}  // namespace graupel::experiments
