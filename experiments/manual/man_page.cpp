#include "experiments/manual/man_page.h"

#include <fmt/format.h>

#include <cctype>
#include <cstddef>
#include <cstdint>
#include <sstream>
#include <string_view>

#include "experiments/manual/command_tree.h"

namespace graupel::experiments {

namespace {

/// The code point of UTF-8 that begins at `at`, which moves behind it.
uint32_t next_code_point(std::string_view text, std::size_t& at) {
  const auto lead = static_cast<unsigned char>(text[at++]);
  if (lead < 0x80) return lead;
  uint32_t code = lead >= 0xf0 ? lead & 0x07u : lead >= 0xe0 ? lead & 0x0fu : lead & 0x1fu;
  while (at < text.size() && (static_cast<unsigned char>(text[at]) & 0xc0u) == 0x80u)
    code = code << 6u | (static_cast<unsigned char>(text[at++]) & 0x3fu);
  return code;
}

/// Text that roff shows as it is: minus signs that can be copied, no macros, ASCII alone.
std::string escaped(std::string_view text) {
  std::string out;
  for (std::size_t at = 0; at < text.size();) {
    const uint32_t code = next_code_point(text, at);
    switch (code) {
      case '\\':
        out += "\\e";
        break;
      case '-':
        out += "\\-";
        break;
      case '\'':
        out += "\\(aq";
        break;
      case '"':
        out += "\\(dq";
        break;
      case '`':
        out += "\\(ga";
        break;
      case '^':
        out += "\\(ha";
        break;
      case '~':
        out += "\\(ti";
        break;
      default:
        out += code < 0x80 ? std::string(1, static_cast<char>(code)) : fmt::format("\\[u{:04X}]", code);
    }
  }
  return out;
}

std::string bold(const std::string& text) { return "\\fB" + escaped(text) + "\\fR"; }
std::string italic(const std::string& text) { return "\\fI" + escaped(text) + "\\fR"; }

/// Lines of at most 78 characters, none of which is taken for a macro.
std::string filled(const std::string& roff) {
  std::istringstream words(roff);
  std::string out, line;
  const auto end_line = [&] {
    if (!line.empty()) out += (line.front() == '.' ? "\\&" : "") + line + "\n";
    line.clear();
  };
  for (std::string word; words >> word;) {
    if (line.size() + 1 + word.size() > 78) end_line();
    line += (line.empty() ? "" : " ") + word;
  }
  end_line();
  return out;
}

std::string sentence(const std::string& text) {
  return text.empty() || std::string_view(".!?").find(text.back()) != std::string_view::npos ? text : text + ".";
}

/// "Graupel: what it is." as "what it is".
std::string summary(const CommandDescription& command) {
  std::string text = command.text;
  const std::size_t colon = text.find(": ");
  if (colon == command.name.size()) text.erase(0, colon + 2);
  if (text.ends_with('.')) text.pop_back();
  return text;
}

/// The text below a command's options: paragraphs, and the lines below "Examples:".
struct Footer {
  std::vector<std::string> paragraphs, examples;
};

Footer parts_of(const std::string& text) {
  Footer footer;
  std::istringstream lines(text);
  bool open = false;
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line == "Examples:") {
      open = false;
    } else if (line.starts_with("  ")) {
      footer.examples.push_back(line.substr(2));
      open = false;
    } else {
      if (!open) footer.paragraphs.emplace_back();
      footer.paragraphs.back() += line + "\n";
      open = true;
    }
  }
  return footer;
}

std::string value_name(const OptionDescription& option) {
  if (option.names_file) return "FILE";
  return option.names_folder ? "FOLDER" : option.value;
}

std::string list_of(const std::vector<std::string>& words) {
  std::string list;
  for (const std::string& word : words) list += (list.empty() ? "" : ", ") + word;
  return list;
}

std::string entry(const OptionDescription& option) {
  std::string head;
  for (const std::string& flag : option.flags) head += (head.empty() ? "" : ", ") + bold(flag);
  if (option.flags.empty()) {
    head = italic(option.word);
  } else if (!option.value.empty()) {
    head += " " + italic(value_name(option));
  }
  if (option.many) head += " ...";
  std::string text = sentence(option.text);
  if (!option.choices.empty()) text += " One of: " + list_of(option.choices) + ".";
  if (!option.delimiter.empty()) text += " Several values are separated by '" + option.delimiter + "'.";
  if (option.required && !option.flags.empty()) text += " Required.";
  if (!option.default_value.empty()) text += " Default: " + option.default_value + ".";
  return ".TP\n" + head + "\n" + filled(escaped(text.empty() ? "Value of " + option.word + "." : text));
}

std::string synopsis(const CommandPath& path) {
  std::string line = "[\\fIoption\\fR ...]";
  if (!path.command->commands.empty()) line = "\\fIcommand\\fR " + line;
  for (const OptionDescription& option : path.command->options) {
    if (option.word.empty()) continue;
    const std::string word = italic(option.word) + (option.many ? " ..." : "");
    line += option.required ? " " + word : " [" + word + "]";
  }
  return ".SH SYNOPSIS\n.B " + escaped(path.joined(" ")) + "\n" + filled(line);
}

std::string see_also(const CommandPath& path, const std::vector<CommandPath>& tree) {
  std::vector<std::string> names;
  for (const CommandPath& other : tree) {
    const bool above = other.words.size() < path.words.size() &&
                       std::equal(other.words.begin(), other.words.end(), path.words.begin());
    const bool below = other.words.size() == path.words.size() + 1 &&
                       std::equal(path.words.begin(), path.words.end(), other.words.begin());
    if (above || below) names.push_back(other.joined("-"));
  }
  std::string text = ".SH SEE ALSO\n";
  for (const std::string& name : names)
    text += ".BR " + escaped(name) + " (1)" + (&name == &names.back() ? "\n" : ",\n");
  return text + ".PP\nThe guides and references are below share/doc/graupel/docs.\n";
}

std::string page_text(const CommandPath& path, const std::vector<CommandPath>& tree, const std::string& version,
                      const std::string& date) {
  const CommandDescription& command = *path.command;
  std::string title = path.joined("-");
  for (char& c : title) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  std::string text = fmt::format(".TH {} 1 {} \"{}\" \"Graupel\"\n.SH NAME\n{} \\- {}\n", escaped(title), date,
                                 escaped(version), escaped(path.joined("-")), escaped(summary(command)));
  text += synopsis(path);
  text += ".SH DESCRIPTION\n" + filled(escaped(sentence(command.text)));
  const Footer footer = parts_of(command.footer);
  for (const std::string& paragraph : footer.paragraphs) text += ".PP\n" + filled(escaped(paragraph));
  if (!command.commands.empty()) text += ".SH COMMANDS\n";
  for (const CommandDescription& other : command.commands)
    text += ".TP\n" + bold(other.name) + "\n" + filled(escaped(sentence(other.text)));
  std::string words, options;
  for (const OptionDescription& option : command.options) (option.flags.empty() ? words : options) += entry(option);
  if (!words.empty()) text += ".SH ARGUMENTS\n" + words;
  if (!options.empty()) text += ".SH OPTIONS\n" + options;
  if (!footer.examples.empty()) {
    text += ".SH EXAMPLES\n.nf\n";
    for (const std::string& line : footer.examples) text += escaped(line) + "\n";
    text += ".fi\n";
  }
  return text + see_also(path, tree);
}

}  // namespace

std::vector<ManPage> man_pages(const CommandDescription& program, const std::string& version, const std::string& date) {
  const std::vector<CommandPath> tree = command_tree(program);
  std::vector<ManPage> pages;
  pages.reserve(tree.size());
  for (const CommandPath& path : tree) pages.push_back({path.joined("-"), page_text(path, tree, version, date)});
  return pages;
}

}  // namespace graupel::experiments
