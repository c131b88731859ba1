// Pickles of arrays as numpy.save makes them. Instructions are written by their letters (Lib/pickletools.py).
#include <limits>

#include "io/pickle.h"

namespace graupel::io {

namespace {

void add_little_endian(std::string& out, uint64_t value, int width) {
  for (int i = 0; i < width; ++i) out += static_cast<char>(value >> (8 * i));
}

void add_text(std::string& out, std::string_view text) {
  out += 'X';
  add_little_endian(out, text.size(), 4);
  out += text;
}

void add_integer(std::string& out, int64_t value) {
  const bool is_short = value >= 0 && value <= std::numeric_limits<int32_t>::max();
  out += is_short ? "J" : "\x8a\x08";
  add_little_endian(out, static_cast<uint64_t>(value), is_short ? 4 : 8);
}

void add_shape(std::string& out, const std::vector<int64_t>& shape) {
  out += '(';
  for (const int64_t size : shape) add_integer(out, size);
  out += 't';
}

/// numpy.dtype(name, False, True), filled with the order of its bytes and its flags.
void add_element_type(std::string& out, const std::string& name) {
  const bool objects = name[0] == 'O';
  out += "cnumpy\ndtype\n";
  add_text(out, name);
  out += "\x89\x88\x87R(K\x03";
  add_text(out, objects ? "|" : "<");
  out += "NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK";
  out += objects ? '\x3f' : '\0';
  out += "tb";
}

}  // namespace

ObjectArrayPickle::ObjectArrayPickle(int64_t count) : out_("\x80\x04") {
  start_array();
  add_shape(out_, {count});
  add_element_type(out_, "O8");
  out_ += "\x89](";
}

/// _reconstruct(ndarray, (0,), b'b'), then the mark of the five parts that fill it and the first of them.
void ObjectArrayPickle::start_array() {
  out_ += "cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK";
  out_ += '\0';
  out_ +=
      "\x85"
      "C\x01"
      "b\x87R(K\x01";
}

void ObjectArrayPickle::add_array(const char* element, const std::vector<int64_t>& shape, const void* values,
                                  std::size_t bytes) {
  const bool is_short = bytes <= std::numeric_limits<uint32_t>::max();
  start_array();
  add_shape(out_, shape);
  add_element_type(out_, element);
  out_ += is_short ? "\x89"
                     "B"
                   : "\x89\x8e";
  add_little_endian(out_, bytes, is_short ? 4 : 8);
  out_.append(static_cast<const char*>(values), bytes);
  out_ += "tb";
}

void ObjectArrayPickle::add_f32(const std::vector<int64_t>& shape, const std::vector<float>& values) {
  add_array("f4", shape, values.data(), values.size() * sizeof(float));
}

void ObjectArrayPickle::add_i64(const std::vector<int64_t>& shape, const std::vector<int64_t>& values) {
  add_array("i8", shape, values.data(), values.size() * sizeof(int64_t));
}

std::string ObjectArrayPickle::finish() && {
  out_ += "etb.";
  return std::move(out_);
}

}  // namespace graupel::io
