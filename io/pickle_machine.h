// The machine that reads pickles: a stack of values, marks in it, and a memory of values by number.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "io/pickle.h"

namespace graupel::io {

class Unpickler {
 public:
  Unpickler(std::string_view bytes, Pickle& out) : bytes_(bytes), out_(out) {}
  /// Throws Unreadable.
  void run();

 private:
  using Kind = PickleKind;

  [[noreturn]] void fail(const std::string& what) const;

  // The bytes of the pickle.
  std::string_view take(uint64_t count);
  uint64_t natural(int width);
  std::string_view line();

  // The stack. Values below the last mark are out of reach.
  bool is_empty() const { return stack_.size() <= (marks_.empty() ? 0 : marks_.back()); }
  PickleValue& push(Kind kind);
  uint32_t pop();
  std::vector<uint32_t> pop_to_mark();
  PickleValue& top();
  PickleValue& at(uint32_t number) { return out_.values_[number]; }
  const PickleValue& at(uint32_t number) const { return out_.values_[number]; }

  // Instructions; those that answer false do not know the code.
  bool constant(unsigned char code);
  bool text(unsigned char code);
  void push_integer(int64_t value) { push(Kind::integer).integer = value; }
  void push_long();
  void push_real();
  bool container(unsigned char code);
  void push_tuple(std::vector<uint32_t> items) { push(Kind::tuple).items = std::move(items); }
  std::vector<uint32_t> pop_items(std::size_t count);
  void extend(const std::vector<uint32_t>& items);
  bool memory(unsigned char code);
  void check_protocol();
  void remember(uint64_t key);
  void recall(uint64_t key);

  // Calls and what they mean (pickle_arrays.cpp).
  bool call(unsigned char code);
  void push_function(std::string_view module, std::string_view name);
  void push_named_function();
  void reduce();
  void make_array(const std::vector<uint32_t>& arguments);
  void make_element_type(const std::vector<uint32_t>& arguments);
  void make_scalar(const std::vector<uint32_t>& arguments);
  void encode(const std::vector<uint32_t>& arguments);
  void build();
  void build_element_type(PickleValue& type, const PickleValue& state);
  void build_array(PickleValue& array, const PickleValue& state);
  void check_values(const PickleValue& array) const;

  std::string_view bytes_;
  Pickle& out_;
  std::size_t place_ = 0, start_ = 0;  ///< in the bytes: the next one, and that of the present instruction
  std::vector<uint32_t> stack_;
  std::vector<std::size_t> marks_;
  std::unordered_map<uint64_t, uint32_t> memo_;
};

}  // namespace graupel::io
