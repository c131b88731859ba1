// Parses JSON with comments through nlohmann-json's SAX interface, noting the line of every value.
#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/system/byte_order_mark.h"
#include "core/system/error.h"
#include "core/system/printable.h"
#include "io/config/json_node.h"

namespace graupel::io {

namespace {

constexpr std::size_t byte_limit = std::size_t(16) << 20;
constexpr std::size_t depth_limit = 64;
constexpr std::size_t value_limit = 1000000;

/// Reports to `consumed` how far the parser has read.
class CountingIterator {
 public:
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = const char&;

  CountingIterator(const char* at, const char** consumed) : at_(at), consumed_(consumed) {}
  reference operator*() const { return *at_; }
  CountingIterator& operator++() {
    *consumed_ = ++at_;
    return *this;
  }
  CountingIterator operator++(int) {
    CountingIterator before = *this;
    ++*this;
    return before;
  }
  bool operator==(const CountingIterator& other) const { return at_ == other.at_; }
  bool operator!=(const CountingIterator& other) const { return at_ != other.at_; }

 private:
  const char* at_;
  const char** consumed_;
};

std::string place(const std::string& name, const char* begin, const char* at) {
  const auto line = 1 + std::count(begin, at, '\n');
  const char* line_start = at;
  while (line_start != begin && line_start[-1] != '\n') --line_start;
  return name + ":" + std::to_string(line) + ":" + std::to_string(at - line_start + 1) + ": ";
}

/// Builds the tree. nlohmann calls one function per token, right after it has read it.
class TreeBuilder : public nlohmann::json_sax<nlohmann::json> {
 public:
  TreeBuilder(const std::string& text, const std::string& name)
      : name_(name), begin_(text.data()), end_(text.data() + text.size()), counted_(begin_), consumed(begin_) {}

  bool null() override { return add(JsonNode()); }
  bool boolean(bool value) override { return add(JsonNode::of(value)); }
  bool number_integer(number_integer_t value) override { return add(JsonNode::of(static_cast<int64_t>(value))); }
  bool number_unsigned(number_unsigned_t value) override { return add(JsonNode::of(static_cast<uint64_t>(value))); }
  bool number_float(number_float_t value, const string_t&) override { return add(JsonNode::of(value)); }
  bool string(string_t& value) override { return add(JsonNode::of(value)); }
  bool binary(binary_t&) override { return false; }
  bool start_object(std::size_t) override { return open(JsonNode::object()); }
  bool start_array(std::size_t) override { return open(JsonNode::array()); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }

  bool key(string_t& value) override {
    if (stack_.back()->find(value)) fail("the key '" + shortened(value) + "' is given twice. Remove one of the two");
    key_ = value;
    return true;
  }

  bool parse_error(std::size_t position, const std::string&, const nlohmann::detail::exception& error) override {
    std::string what = error.what();
    if (const auto start = what.find("column "); start != std::string::npos)
      if (const auto colon = what.find(": ", start); colon != std::string::npos) what = what.substr(colon + 2);
    const char* at = begin_ + std::min<std::size_t>(position > 0 ? position - 1 : 0, end_ - begin_);
    throw InputError(place(name_, begin_, at) + "not valid JSON (" + what.substr(0, 300) +
                     "). Correct the file at this place");
  }

  JsonNode root;

 private:
  [[noreturn]] void fail(const std::string& problem) const {
    throw ConfigError(place(name_, begin_, std::max(begin_, consumed - 1)) + problem);
  }

  /// Line of the token just read. The parser may be one character ahead (behind a number), so that one is left out.
  int line() {
    const char* until = std::max(counted_, consumed - 1);
    line_ += static_cast<int>(std::count(counted_, until, '\n'));
    counted_ = until;
    return line_;
  }

  JsonNode& place_node(JsonNode&& node) {
    if (++count_ > value_limit)
      fail("too many values (at most " + std::to_string(value_limit) + "). Move geometry to files of its own");
    node.line = line();
    if (stack_.empty()) return root = std::move(node);
    JsonNode& parent = *stack_.back();
    if (parent.kind == JsonNode::Kind::object) {
      parent.members.push_back({key_, std::move(node)});
      return parent.members.back().value;
    }
    parent.items.push_back(std::move(node));
    return parent.items.back();
  }

  bool add(JsonNode&& node) {
    place_node(std::move(node));
    return true;
  }

  bool open(JsonNode&& node) {
    if (stack_.size() >= depth_limit)
      fail("nested too deeply (at most " + std::to_string(depth_limit) + " levels). Take levels out");
    stack_.push_back(&place_node(std::move(node)));
    return true;
  }

  bool close() {
    stack_.pop_back();
    return true;
  }

  const std::string& name_;
  const char* begin_;
  const char* end_;
  const char* counted_;
  int line_ = 1;
  std::size_t count_ = 0;
  std::string key_;
  std::vector<JsonNode*> stack_;  // open containers; only the innermost one grows, so the pointers stay valid

 public:
  const char* consumed;
};

/// nlohmann-json takes the first NUL for the text's end.
void check_encoding(const std::string& text, const std::string& name) {
  if (const auto wide = wide_encoding(text); !wide.empty())
    throw InputError(name + ": not valid JSON (the text is " + std::string(wide) +
                     " by its byte order mark; allowed: UTF-8). Save it as UTF-8");
  const std::size_t nul = text.find('\0');
  if (nul == std::string::npos) return;
  throw InputError(place(name, text.data(), text.data() + nul) +
                   "not valid JSON (a NUL byte). Correct the file at this place, or save it as UTF-8");
}

}  // namespace

JsonNode parse_json(const std::string& text, const std::string& name) {
  if (text.size() > byte_limit)
    throw ConfigError(name + ": the text is too large (" + std::to_string(text.size()) + " bytes, at most " +
                      std::to_string(byte_limit) + "). Move geometry to files of its own");
  check_encoding(text, name);
  TreeBuilder builder(text, name);
  const CountingIterator first(text.data(), &builder.consumed);
  const CountingIterator last(text.data() + text.size(), &builder.consumed);
  nlohmann::json::sax_parse(first, last, &builder, nlohmann::json::input_format_t::json, true, true);
  return std::move(builder.root);
}

}  // namespace graupel::io
