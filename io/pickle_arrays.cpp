// What pickles call: NumPy's functions, by the few meanings that they have here.
#include <algorithm>

#include "io/pickle_machine.h"
#include "io/unreadable.h"

namespace graupel::io {

namespace {

constexpr std::size_t most_dimensions = 32;

struct KnownFunction {
  std::string_view module, name;
  PickleFunction meaning;
};
/// NumPy 2 calls its inner modules numpy._core.
constexpr KnownFunction known_functions[] = {{"numpy.core.multiarray", "_reconstruct", PickleFunction::make_array},
                                             {"numpy._core.multiarray", "_reconstruct", PickleFunction::make_array},
                                             {"numpy.core.multiarray", "scalar", PickleFunction::make_scalar},
                                             {"numpy._core.multiarray", "scalar", PickleFunction::make_scalar},
                                             {"numpy", "ndarray", PickleFunction::array_class},
                                             {"numpy", "dtype", PickleFunction::element_type_class},
                                             {"_codecs", "encode", PickleFunction::encode}};

std::string printable(std::string_view text) {
  std::string out(text.substr(0, 60));
  std::replace_if(
      out.begin(), out.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return out;
}

}  // namespace

void Unpickler::push_function(std::string_view module, std::string_view name) {
  for (const KnownFunction& known : known_functions)
    if (known.module == module && known.name == name) {
      push(Kind::function).function = known.meaning;
      return;
    }
  fail("it names '" + printable(module) + "." + printable(name) + "', which is refused: arrays do not need it");
}

void Unpickler::push_named_function() {
  const PickleValue &name = at(pop()), &module = at(pop());
  if (name.kind != Kind::text || module.kind != Kind::text) fail("it names a function by something else than texts");
  push_function(module.bytes, name.bytes);
}

bool Unpickler::call(unsigned char code) {
  switch (code) {
    case 'c': {
      const std::string_view module = line();
      push_function(module, line());
      return true;
    }
    case 0x93:
      push_named_function();
      return true;
    case 'R':
      reduce();
      return true;
    case 'b':
      build();
      return true;
    default:
      return false;
  }
}

void Unpickler::reduce() {
  const PickleValue &arguments = at(pop()), &function = at(pop());
  if (function.kind != Kind::function) fail(std::string("it calls ") + name_of(function.kind));
  if (arguments.kind != Kind::tuple) fail("it calls a function without a tuple of arguments");
  switch (function.function) {
    case PickleFunction::make_array:
      return make_array(arguments.items);
    case PickleFunction::element_type_class:
      return make_element_type(arguments.items);
    case PickleFunction::make_scalar:
      return make_scalar(arguments.items);
    case PickleFunction::encode:
      return encode(arguments.items);
    case PickleFunction::array_class:
      break;
  }
  fail("it calls the class numpy.ndarray itself, which is refused");
}

/// _reconstruct(ndarray, (0,), b'b'): an array whose contents follow.
void Unpickler::make_array(const std::vector<uint32_t>& arguments) {
  if (arguments.size() != 3 || at(arguments[0]).kind != Kind::function ||
      at(arguments[0]).function != PickleFunction::array_class)
    fail("it makes an array of a class that is not numpy.ndarray");
  push(Kind::array).complete = false;
}

/// dtype('f4', False, True); the order of the bytes follows.
void Unpickler::make_element_type(const std::vector<uint32_t>& arguments) {
  const PickleValue* name = arguments.empty() ? nullptr : &at(arguments[0]);
  if (!name || (name->kind != Kind::text && name->kind != Kind::bytes)) fail("it has an element type without a name");
  constexpr std::string_view known[] = {"f4", "f8", "i1", "i2", "i4", "i8", "u1",
                                        "u2", "u4", "u8", "b1", "O8", "O4", "f2"};
  if (std::find(std::begin(known), std::end(known), name->bytes) == std::end(known))
    fail("it has an array of the element type '" + printable(name->bytes) + "', which is not read");
  const ElementType type{name->bytes[0], name->bytes[1] - '0', false};
  push(Kind::element_type).element = type;
}

/// scalar(dtype, bytes): one number.
void Unpickler::make_scalar(const std::vector<uint32_t>& arguments) {
  if (arguments.size() != 2 || at(arguments[0]).kind != Kind::element_type || at(arguments[1]).kind != Kind::bytes)
    fail("it has a number without type and bytes");
  const ElementType type = at(arguments[0]).element;
  const std::string_view bytes = at(arguments[1]).bytes;
  PickleValue& number = push(Kind::array);
  number.element = type;
  number.bytes = bytes;
  check_values(number);
}

/// encode(text, 'latin1'): how protocol 2 writes bytes.
void Unpickler::encode(const std::vector<uint32_t>& arguments) {
  if (arguments.size() != 2 || at(arguments[0]).kind != Kind::text || at(arguments[1]).kind != Kind::text ||
      (at(arguments[1]).bytes != "latin1" && at(arguments[1]).bytes != "latin-1"))
    fail("it encodes something else than a text as latin1");
  const std::string_view text = at(arguments[0]).bytes;
  std::string& bytes = out_.texts_.emplace_back();
  bytes.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto first = static_cast<unsigned char>(text[i]);
    if (first < 0x80) {
      bytes += text[i];
      continue;
    }
    const auto second = static_cast<unsigned char>(i + 1 < text.size() ? text[i + 1] : 0);
    if ((first != 0xc2 && first != 0xc3) || (second & 0xc0) != 0x80) fail("it encodes a text that is not latin1");
    bytes += static_cast<char>(((first & 3) << 6) | (second & 0x3f));
    ++i;
  }
  push(Kind::bytes).bytes = bytes;
}

void Unpickler::build() {
  const PickleValue& state = at(pop());
  PickleValue& value = top();
  if (state.kind != Kind::tuple) fail("it fills a value without a tuple");
  if (value.kind == Kind::element_type) return build_element_type(value, state);
  if (value.kind == Kind::array && !value.complete) return build_array(value, state);
  fail(std::string("it fills ") + name_of(value.kind) + ", which is refused");
}

/// (3, '<', None, None, None, -1, -1, 0)
void Unpickler::build_element_type(PickleValue& type, const PickleValue& state) {
  const PickleValue* order = state.items.size() < 2 ? nullptr : &at(state.items[1]);
  if (!order || (order->kind != Kind::text && order->kind != Kind::bytes) || order->bytes.size() != 1 ||
      std::string_view("<>|=").find(order->bytes[0]) == std::string_view::npos)
    fail("it has an element type without an order of its bytes");
  type.element.big_endian = order->bytes[0] == '>';
}

/// (1, shape, dtype, fortran_order, bytes or list)
void Unpickler::build_array(PickleValue& array, const PickleValue& state) {
  if (state.items.size() != 5) fail("it fills an array without its five parts");
  const PickleValue &shape = at(state.items[1]), &type = at(state.items[2]), &order = at(state.items[3]),
                    &values = at(state.items[4]);
  if (shape.kind != Kind::tuple || shape.items.size() > most_dimensions || type.kind != Kind::element_type ||
      (order.kind != Kind::boolean && order.kind != Kind::integer))
    fail("it fills an array without shape, element type and order");
  for (const uint32_t number : shape.items) {
    if (at(number).kind != Kind::integer || at(number).integer < 0) fail("it has an array of a negative size");
    array.shape.push_back(at(number).integer);
  }
  array.element = type.element;
  array.fortran_order = order.integer != 0;
  const bool objects = array.element.kind == 'O';
  if (values.kind != (objects ? Kind::list : Kind::bytes))
    fail(std::string("it fills an array of ") + (objects ? "objects" : "numbers") + " with " + name_of(values.kind));
  array.bytes = values.bytes;
  if (objects) array.items = values.items;
  array.complete = true;
  check_values(array);
}

void Unpickler::check_values(const PickleValue& array) const {
  uint64_t count = 1;
  for (const int64_t size : array.shape)
    if (__builtin_mul_overflow(count, static_cast<uint64_t>(size), &count)) fail("it has an array of impossible size");
  const bool objects = array.element.kind == 'O';
  const uint64_t present = objects ? array.items.size() : array.bytes.size();
  uint64_t wanted = count;
  if (!objects && __builtin_mul_overflow(count, static_cast<uint64_t>(array.element.bytes), &wanted))
    fail("it has an array of impossible size");
  if (present != wanted)
    fail("it has an array of " + std::to_string(count) + " elements with " + std::to_string(present) +
         (objects ? " objects" : " bytes"));
}

}  // namespace graupel::io
