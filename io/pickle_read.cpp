// The instructions of pickles that are read, but for calls.
#include <algorithm>
#include <cstring>

#include "io/pickle_machine.h"
#include "io/unreadable.h"

namespace graupel::io {

namespace {

constexpr std::size_t most_values = std::size_t(1) << 22;
constexpr uint64_t latest_protocol = 5;

/// Texts and bytes: an instruction, the width of the length that follows it.
struct TextCode {
  unsigned char code;
  PickleKind kind;
  int width;
};
constexpr TextCode text_codes[] = {{'U', PickleKind::bytes, 1},  {'T', PickleKind::bytes, 4},  // str of Python 2
                                   {'C', PickleKind::bytes, 1},  {'B', PickleKind::bytes, 4},
                                   {0x8e, PickleKind::bytes, 8}, {0x8c, PickleKind::text, 1},
                                   {'X', PickleKind::text, 4},   {0x8d, PickleKind::text, 8}};

}  // namespace

const char* name_of(PickleKind kind) {
  constexpr const char* names[] = {"None",    "a truth value", "a whole number", "a real number",   "a text",  "bytes",
                                   "a tuple", "a list",        "a function",     "an element type", "an array"};
  return names[static_cast<std::size_t>(kind)];
}

void Unpickler::fail(const std::string& what) const {
  throw Unreadable("its pickle is not read: " + what + " (byte " + std::to_string(start_) + ")");
}

void Unpickler::run() {
  for (;;) {
    start_ = place_;
    const auto code = static_cast<unsigned char>(take(1)[0]);
    if (code == '.') break;
    if (constant(code) || text(code) || container(code) || memory(code) || call(code)) continue;
    constexpr char digits[] = "0123456789abcdef";
    fail(std::string("the instruction 0x") + digits[code >> 4] + digits[code & 15] +
         ", which arrays do not need, is refused");
  }
  if (stack_.size() != 1 || !marks_.empty()) fail("it ends with values left over");
  if (place_ != bytes_.size()) fail("bytes follow its end");
  out_.root_ = stack_.back();
}

std::string_view Unpickler::take(uint64_t count) {
  if (count > bytes_.size() - place_) fail("it is cut short");
  const std::string_view taken = bytes_.substr(place_, count);
  place_ += count;
  return taken;
}

/// Little endian.
uint64_t Unpickler::natural(int width) {
  uint64_t value = 0;
  const std::string_view bytes = take(static_cast<uint64_t>(width));
  for (std::size_t i = bytes.size(); i-- > 0;) value = (value << 8) | static_cast<unsigned char>(bytes[i]);
  return value;
}

std::string_view Unpickler::line() {
  const std::size_t end = bytes_.find('\n', place_);
  if (end == std::string_view::npos) fail("it is cut short");
  const std::string_view text = bytes_.substr(place_, end - place_);
  place_ = end + 1;
  return text;
}

PickleValue& Unpickler::push(Kind kind) {
  if (out_.values_.size() >= most_values) fail("it has more than 4 million values");
  out_.values_.emplace_back().kind = kind;
  stack_.push_back(static_cast<uint32_t>(out_.values_.size() - 1));
  return out_.values_.back();
}

uint32_t Unpickler::pop() {
  if (is_empty()) fail("it takes a value where there is none");
  const uint32_t value = stack_.back();
  stack_.pop_back();
  return value;
}

PickleValue& Unpickler::top() {
  if (is_empty()) fail("it needs a value where there is none");
  return at(stack_.back());
}

std::vector<uint32_t> Unpickler::pop_to_mark() {
  if (marks_.empty()) fail("it lacks a mark");
  const auto first = stack_.begin() + static_cast<std::ptrdiff_t>(marks_.back());
  std::vector<uint32_t> items(first, stack_.end());
  stack_.erase(first, stack_.end());
  marks_.pop_back();
  return items;
}

bool Unpickler::constant(unsigned char code) {
  switch (code) {
    case 'N':
      push(Kind::none);
      return true;
    case 0x88:
    case 0x89:
      push(Kind::boolean).integer = code == 0x88 ? 1 : 0;
      return true;
    case 'K':
      push_integer(static_cast<int64_t>(natural(1)));
      return true;
    case 'M':
      push_integer(static_cast<int64_t>(natural(2)));
      return true;
    case 'J':
      push_integer(static_cast<int32_t>(static_cast<uint32_t>(natural(4))));
      return true;
    case 0x8a:
      push_long();
      return true;
    case 'G':
      push_real();
      return true;
    default:
      return false;
  }
}

bool Unpickler::text(unsigned char code) {
  for (const TextCode& known : text_codes)
    if (known.code == code) {
      const uint64_t length = natural(known.width);
      push(known.kind).bytes = take(length);
      return true;
    }
  return false;
}

/// Two's complement of any width.
void Unpickler::push_long() {
  const uint64_t width = natural(1);
  if (width > 8) fail("it has a whole number of more than 64 bits");
  uint64_t value = natural(static_cast<int>(width));
  if (width > 0 && width < 8 && (value >> (8 * width - 1)) != 0) value |= ~uint64_t(0) << (8 * width);
  push_integer(static_cast<int64_t>(value));
}

/// Big endian.
void Unpickler::push_real() {
  std::string bytes(take(8));
  std::reverse(bytes.begin(), bytes.end());
  std::memcpy(&push(Kind::real).real, bytes.data(), 8);
}

std::vector<uint32_t> Unpickler::pop_items(std::size_t count) {
  std::vector<uint32_t> items(count);
  for (std::size_t i = count; i-- > 0;) items[i] = pop();
  return items;
}

void Unpickler::extend(const std::vector<uint32_t>& items) {
  PickleValue& list = top();
  if (list.kind != Kind::list) fail(std::string("it appends to ") + name_of(list.kind));
  list.items.insert(list.items.end(), items.begin(), items.end());
}

bool Unpickler::container(unsigned char code) {
  switch (code) {
    case '(':
      marks_.push_back(stack_.size());
      return true;
    case ')':
      push_tuple({});
      return true;
    case 0x85:
    case 0x86:
    case 0x87:
      push_tuple(pop_items(code - 0x84u));
      return true;
    case 't':
      push_tuple(pop_to_mark());
      return true;
    case ']':
      push(Kind::list);
      return true;
    case 'a':
      extend(pop_items(1));
      return true;
    case 'e':
      extend(pop_to_mark());
      return true;
    default:
      return false;
  }
}

void Unpickler::check_protocol() {
  const uint64_t protocol = natural(1);
  if (protocol > latest_protocol) fail("its protocol is " + std::to_string(protocol) + " (read are those up to 5)");
}

void Unpickler::remember(uint64_t key) {
  top();
  memo_[key] = stack_.back();
}

void Unpickler::recall(uint64_t key) {
  const auto found = memo_.find(key);
  if (found == memo_.end()) fail("it recalls a value that it did not store");
  stack_.push_back(found->second);
}

bool Unpickler::memory(unsigned char code) {
  switch (code) {
    case 0x80:
      check_protocol();
      return true;
    case 0x95:
      natural(8);  // the length of a frame: a hint
      return true;
    case 'q':
      remember(natural(1));
      return true;
    case 'r':
      remember(natural(4));
      return true;
    case 0x94:
      remember(memo_.size());
      return true;
    case 'h':
      recall(natural(1));
      return true;
    case 'j':
      recall(natural(4));
      return true;
    default:
      return false;
  }
}

Pickle read_pickle(std::string_view bytes) {
  Pickle out;
  Unpickler(bytes, out).run();
  return out;
}

}  // namespace graupel::io
