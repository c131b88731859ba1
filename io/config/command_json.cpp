#include "io/config/command_json.h"

#include <vector>

#include "io/config/json_node.h"

namespace graupel::io {

namespace {

JsonNode node_of(const std::vector<std::string>& words) {
  JsonNode list = JsonNode::array();
  for (const std::string& word : words) list.items.push_back(JsonNode::of(word));
  return list;
}

/// Members of a description in the order of the struct; empty ones are left out.
struct Writer {
  JsonNode node = JsonNode::object();

  void operator()(const char* key, const std::string& text) {
    if (!text.empty()) node.set(key, JsonNode::of(text));
  }
  void operator()(const char* key, const std::vector<std::string>& words) {
    if (!words.empty()) node.set(key, node_of(words));
  }
  void operator()(const char* key, bool value) {
    if (value) node.set(key, JsonNode::of(true));
  }
};

struct Reader {
  const JsonNode& node;

  void operator()(const char* key, std::string& text) const {
    if (const JsonNode* found = node.find(key)) text = found->text;
  }
  void operator()(const char* key, std::vector<std::string>& words) const {
    if (const JsonNode* found = node.find(key))
      for (const JsonNode& word : found->items) words.push_back(word.text);
  }
  void operator()(const char* key, bool& value) const {
    if (const JsonNode* found = node.find(key)) value = found->boolean;
  }
};

template <typename Visitor, typename Option>
void visit_option(Visitor&& visit, Option& option) {
  visit("flags", option.flags);
  visit("word", option.word);
  visit("value", option.value);
  visit("text", option.text);
  visit("default", option.default_value);
  visit("choices", option.choices);
  visit("suggestions", option.suggestions);
  visit("file_endings", option.file_endings);
  visit("names_file", option.names_file);
  visit("names_folder", option.names_folder);
  visit("required", option.required);
  visit("repeats", option.repeats);
  visit("many", option.many);
  visit("delimiter", option.delimiter);
}

template <typename Visitor, typename Command>
void visit_command(Visitor&& visit, Command& command) {
  visit("name", command.name);
  visit("text", command.text);
  visit("footer", command.footer);
}

JsonNode node_of(const CommandDescription& command) {
  Writer writer;
  visit_command(writer, command);
  JsonNode options = JsonNode::array(), commands = JsonNode::array();
  for (const OptionDescription& option : command.options) {
    Writer member;
    visit_option(member, option);
    options.items.push_back(std::move(member.node));
  }
  for (const CommandDescription& other : command.commands) commands.items.push_back(node_of(other));
  writer.node.set("options", std::move(options));
  writer.node.set("commands", std::move(commands));
  return std::move(writer.node);
}

CommandDescription command_of(const JsonNode& node) {
  CommandDescription command;
  const Reader reader{node};
  visit_command(reader, command);
  if (const JsonNode* options = node.find("options"))
    for (const JsonNode& item : options->items) visit_option(Reader{item}, command.options.emplace_back());
  if (const JsonNode* commands = node.find("commands"))
    for (const JsonNode& item : commands->items) command.commands.push_back(command_of(item));
  return command;
}

}  // namespace

std::string command_json(const CommandDescription& command) {
  return write_json(node_of(command), JsonLayout::indented) + "\n";
}

CommandDescription parse_command_json(const std::string& text, const std::string& name) {
  return command_of(parse_json(text, name));
}

}  // namespace graupel::io
