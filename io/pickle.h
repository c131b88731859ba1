// Python pickles of NumPy arrays as plain values. A pickle is a program for a small machine that may name any Python
// function and call it; this reader knows only the instructions that arrays, numbers, texts, tuples and lists need,
// gives NumPy's own functions a fixed meaning and calls nothing. Everything else is refused.
// Instructions: Lib/pickletools.py of Python; arrays: __reduce__ of numpy.ndarray and numpy.dtype.
#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <string_view>
#include <vector>

namespace graupel::io {

enum class PickleKind { none, boolean, integer, real, text, bytes, tuple, list, function, element_type, array };

/// "a tuple", for messages.
const char* name_of(PickleKind kind);

/// Functions that a pickle may name.
enum class PickleFunction { make_array, array_class, element_type_class, make_scalar, encode };

struct ElementType {
  char kind = 0;  ///< 'f' real, 'i' and 'u' whole, 'b' truth values, 'O' objects
  int bytes = 0;
  bool big_endian = false;
};

struct PickleValue {
  PickleKind kind = PickleKind::none;
  bool complete = true;  ///< false for an array that its values have not followed yet
  int64_t integer = 0;   ///< and truth values
  double real = 0;
  std::string_view bytes;       ///< of text (UTF-8), bytes, and the values of an array of numbers
  std::vector<uint32_t> items;  ///< of a tuple, a list, an array of objects (row by row)
  PickleFunction function = {};
  ElementType element;         ///< of an array and an element type
  std::vector<int64_t> shape;  ///< of an array; empty for a single number
  bool fortran_order = false;
};

/// All values of a pickle. Values name each other by number, so that a value may occur in many places, or in itself.
class Pickle {
 public:
  const PickleValue& root() const { return values_[root_]; }
  const PickleValue& at(uint32_t number) const { return values_[number]; }

 private:
  friend class Unpickler;
  std::deque<PickleValue> values_;
  std::deque<std::string> texts_;  ///< bytes that the pickle does not hold as they are
  uint32_t root_ = 0;
};

/// The values point into `bytes`. Throws Unreadable, with the place and what was found.
Pickle read_pickle(std::string_view bytes);

/// The pickle of a NumPy array of objects, whose elements are arrays themselves.
class ObjectArrayPickle {
 public:
  explicit ObjectArrayPickle(int64_t count);
  void add_f32(const std::vector<int64_t>& shape, const std::vector<float>& values);
  void add_i64(const std::vector<int64_t>& shape, const std::vector<int64_t>& values);
  /// Call it last, once.
  std::string finish() &&;

 private:
  void start_array();
  void add_array(const char* element, const std::vector<int64_t>& shape, const void* values, std::size_t bytes);
  std::string out_;
};

}  // namespace graupel::io
