#include "io/npy_header.h"

#include <charconv>

#include "io/unreadable.h"

namespace graupel::io {

namespace {

constexpr std::string_view magic = "\x93NUMPY";
constexpr std::size_t alignment = 64;
constexpr std::size_t most_dimensions = 32;

/// The dictionary, e.g. {'descr': '|O', 'fortran_order': False, 'shape': (2,), }.
class HeaderParser {
 public:
  explicit HeaderParser(std::string_view text) : rest_(text) {}

  NpyHeader parse() {
    NpyHeader header;
    int keys = 0;
    expect("{");
    while (!accept("}")) {
      const std::string key = quoted();
      expect(":");
      if (key == "descr")
        header.element = quoted();
      else if (key == "fortran_order")
        header.fortran_order = boolean();
      else if (key == "shape")
        header.shape = shape();
      else
        fail("has the unknown key '" + key.substr(0, 40) + "'");
      ++keys;
      if (!accept(",")) {
        expect("}");
        break;
      }
    }
    skip_space();
    if (keys != 3 || !rest_.empty()) fail("does not hold descr, fortran_order and shape alone");
    return header;
  }

 private:
  [[noreturn]] static void fail(const std::string& what) { throw Unreadable("its .npy header " + what); }

  void skip_space() {
    while (!rest_.empty() && (rest_.front() == ' ' || rest_.front() == '\n')) rest_.remove_prefix(1);
  }
  bool accept(std::string_view word) {
    skip_space();
    if (!rest_.starts_with(word)) return false;
    rest_.remove_prefix(word.size());
    return true;
  }
  void expect(std::string_view word) {
    if (!accept(word)) fail("lacks '" + std::string(word) + "'");
  }
  std::string quoted() {
    skip_space();
    const char quote = rest_.empty() ? '\0' : rest_.front();
    if (quote != '\'' && quote != '"') fail("describes records or something else than one element type");
    const std::size_t end = rest_.find(quote, 1);
    if (end == std::string_view::npos) fail("is cut short");
    std::string text(rest_.substr(1, end - 1));
    rest_.remove_prefix(end + 1);
    return text;
  }
  bool boolean() {
    if (accept("True")) return true;
    expect("False");
    return false;
  }
  int64_t number() {
    skip_space();
    int64_t value = 0;
    const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
    if (error != std::errc() || value < 0) fail("has a shape that is not of whole numbers");
    rest_.remove_prefix(static_cast<std::size_t>(end - rest_.data()));
    accept("L");  // Python 2
    return value;
  }
  std::vector<int64_t> shape() {
    std::vector<int64_t> sizes;
    expect("(");
    while (!accept(")")) {
      sizes.push_back(number());
      if (sizes.size() > most_dimensions) fail("has more than 32 dimensions");
      if (accept(",")) continue;
      expect(")");
      break;
    }
    return sizes;
  }

  std::string_view rest_;
};

std::size_t little_endian(std::string_view bytes) {
  std::size_t value = 0;
  for (std::size_t i = bytes.size(); i-- > 0;) value = (value << 8) | static_cast<unsigned char>(bytes[i]);
  return value;
}

}  // namespace

NpyHeader read_npy_header(std::string_view file) {
  if (!file.starts_with(magic)) throw Unreadable("it is no .npy array (its first bytes are not \\x93NUMPY)");
  if (file.size() < 12) throw Unreadable("its .npy header is cut short");
  const int version = static_cast<unsigned char>(file[6]);
  if (version < 1 || version > 3)
    throw Unreadable("its .npy version is " + std::to_string(version) + " (read are 1 to 3)");
  const std::size_t width = version == 1 ? 2 : 4, start = 8 + width;
  const std::size_t length = little_endian(file.substr(8, width));
  if (length > file.size() - start) throw Unreadable("its .npy header is cut short");
  NpyHeader header = HeaderParser(file.substr(start, length)).parse();
  header.bytes = start + length;
  return header;
}

std::string npy_object_header(int64_t count) {
  std::string text = "{'descr': '|O', 'fortran_order': False, 'shape': (" + std::to_string(count) + ",), }";
  const std::size_t before = magic.size() + 4;
  text.resize((before + text.size() + 1 + alignment - 1) / alignment * alignment - before - 1, ' ');
  text += '\n';
  std::string header(magic);
  header += {'\x01', '\0', static_cast<char>(text.size() & 0xff), static_cast<char>(text.size() >> 8)};
  return header + text;
}

}  // namespace graupel::io
