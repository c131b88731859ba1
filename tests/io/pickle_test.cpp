// Pickles: arrays come back, and nothing that they do not need is read, whatever the bytes.
#include "io/pickle.h"

#include <gtest/gtest.h>

#include "io/npy_header.h"
#include "io/pickle_numbers.h"
#include "io/unreadable.h"
#include "tests/io/expect_error.h"

namespace graupel::io {
namespace {

using namespace std::string_literals;

void expect_refused(const std::string& pickle, const std::string& words) {
  expect_error<Unreadable>([&] { read_pickle(pickle); }, {words, "(byte "});
}

std::string sample_pickle() {
  ObjectArrayPickle pickle(2);
  pickle.add_f32({2, 1, 3}, {1, -2.5f, 3, 4, 5, 6e-30f});
  pickle.add_i64({3}, {7, -8, int64_t(1) << 40});
  return std::move(pickle).finish();
}

const std::string array_of_numbers =
    "\x80\x02"
    "cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n(K\0tU\x01"
    "btR"s;

/// An array of this shape, element type and raw bytes, as Python 2 pickles it.
std::string numbers(const std::string& shape, const std::string& type, const std::string& raw) {
  return array_of_numbers + "(K\x01" + "(" + shape + "t" + "cnumpy\ndtype\n(U\x02" + type +
         "K\0K\x01tR(K\x03U\x01<NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\0tb\x89U"s + static_cast<char>(raw.size()) +
         raw + "tb.";
}

TEST(Pickle, ArraysComeBack) {
  const std::string bytes = sample_pickle();
  const Pickle pickle = read_pickle(bytes);
  const PickleValue& root = pickle.root();
  ASSERT_EQ(root.kind, PickleKind::array);
  EXPECT_EQ(root.shape, std::vector<int64_t>{2});
  ASSERT_EQ(root.items.size(), 2u);
  const PickleValue &reals = pickle.at(root.items[0]), &wholes = pickle.at(root.items[1]);
  EXPECT_EQ(reals.shape, (std::vector<int64_t>{2, 1, 3}));
  EXPECT_EQ(real_numbers(reals), (std::vector<float>{1, -2.5f, 3, 4, 5, 6e-30f}));
  EXPECT_EQ(whole_numbers(wholes), (std::vector<int64_t>{7, -8, int64_t(1) << 40}));
}

TEST(Pickle, ArraysOfNumPyTwoAreRead) {
  std::string bytes = sample_pickle();
  const std::string one = "cnumpy.core.", two = "cnumpy._core.";
  for (std::size_t at = bytes.find(one); at != std::string::npos; at = bytes.find(one, at)) bytes.replace(at, 12, two);
  EXPECT_EQ(read_pickle(bytes).root().items.size(), 2u);
}

TEST(Pickle, ArraysOfPythonTwoAreRead) {
  const std::string bytes = numbers("K\x02", "u1", "\x05\xff");
  const Pickle pickle = read_pickle(bytes);
  EXPECT_EQ(whole_numbers(pickle.root()), (std::vector<int64_t>{5, 255}));
}

TEST(Pickle, EveryCutIsRefused) {
  const std::string bytes = sample_pickle();
  for (std::size_t length = 0; length < bytes.size(); ++length)
    EXPECT_THROW(read_pickle(std::string_view(bytes).substr(0, length)), Unreadable) << length;
}

TEST(Pickle, EveryChangedByteIsReadOrRefused) {
  const std::string bytes = sample_pickle();
  int refused = 0;
  for (std::size_t place = 0; place < bytes.size(); ++place)
    for (const int flip : {1, 0x20, 0x80, 0xff}) {
      std::string changed = bytes;
      changed[place] = static_cast<char>(changed[place] ^ flip);
      try {
        const Pickle pickle = read_pickle(changed);
        for (const uint32_t item : pickle.root().items) pickle.at(item);
      } catch (const Unreadable&) {
        ++refused;
      }
    }
  EXPECT_GT(refused, 1000);
}

TEST(Pickle, FunctionsAreRefusedByName) {
  expect_refused(
      "\x80\x02"
      "cos\nsystem\n(X\x02\0\0\0lstR."s,
      "it names 'os.system', which is refused");
  expect_refused(
      "\x80\x04\x8c\x08"
      "builtins\x8c\x04"
      "eval\x93."s,
      "it names 'builtins.eval', which is refused");
  expect_refused("cnumpy\nload\n."s, "it names 'numpy.load', which is refused");
  expect_refused("cos\x1b[2J\nsystem\n."s, "'os?[2J.system'");  // no control codes on the terminal
}

TEST(Pickle, CallsOfOtherThingsAreRefused) {
  expect_refused("K\x01)R."s, "it calls a whole number");
  expect_refused("cnumpy\nndarray\n)R."s, "numpy.ndarray itself");
  expect_refused("cnumpy\ndtype\nK\x01R."s, "without a tuple of arguments");
  expect_refused("cnumpy.core.multiarray\n_reconstruct\n(cnumpy\ndtype\n)K\x01tR."s,
                 "a class that is not numpy.ndarray");
  expect_refused("c_codecs\nencode\n(X\x01\0\0\0aX\x05\0\0\0utf-8tR."s, "as latin1");
  expect_refused("])b."s, "it fills a list");
}

TEST(Pickle, UnknownInstructionsAreRefused) {
  expect_refused("\x80\x02}."s, "the instruction 0x7d");  // a dictionary
  expect_refused("\x80\x02(cos\nsystem\no."s, "it names 'os.system'");
  expect_refused("\x80\x02(ios\nsystem\n."s, "the instruction 0x69");  // INST
  expect_refused("\x80\x02P1\n."s, "the instruction 0x50");            // PERSID
  expect_refused("\x80\x02\x82\x01."s, "the instruction 0x82");        // EXT1
  expect_refused("\x80\x02)\x81."s, "the instruction 0x81");           // NEWOBJ
  expect_refused("\x80\x09N."s, "its protocol is 9");
}

TEST(Pickle, SizesThatDoNotFitAreRefused) {
  expect_refused("B\xff\xff\xff\xff"s, "it is cut short");
  expect_refused("\x8e\xff\xff\xff\xff\xff\xff\xff\xff"s, "it is cut short");
  expect_refused("\x8a\x09\1\1\1\1\1\1\1\1\1."s, "more than 64 bits");
  expect_refused(numbers("K\x03", "f4", "abcd"), "an array of 3 elements with 4 bytes");
  const std::string huge = "\x8a\x08\0\0\0\0\0\0\0\x40"s;
  expect_refused(numbers(huge + huge, "f4", "abcd"), "impossible size");
  expect_refused(numbers(huge, "f8", ""), "impossible size");
  expect_refused(numbers("J\xff\xff\xff\xff", "f4", "abcd"), "a negative size");
  expect_refused(numbers("K\x01", "V4", "abcd"), "the element type 'V4'");
  expect_refused(std::string(5'000'000, 'N') + ".", "more than 4 million values");
}

TEST(Pickle, StackAndMemoryAreGuarded) {
  expect_refused("."s, "values left over");
  expect_refused("NN."s, "values left over");
  expect_refused("(N."s, "values left over");
  expect_refused("\x85."s, "takes a value where there is none");
  expect_refused("N(\x85."s, "takes a value where there is none");  // below the mark
  expect_refused("t."s, "lacks a mark");
  expect_refused("h\x07."s, "recalls a value that it did not store");
  expect_refused("q\x01."s, "needs a value where there is none");
  expect_refused("N.N"s, "bytes follow its end");
}

TEST(Pickle, NestingAndLoopsAreHarmless) {
  EXPECT_EQ(read_pickle(")" + std::string(1'000'000, '\x85') + ".").root().items.size(), 1u);
  const Pickle loop = read_pickle("]q\0h\0a."s);  // a list that holds itself
  EXPECT_EQ(&loop.at(loop.root().items[0]), &loop.root());
}

TEST(NpyHeader, ComesBack) {
  const std::string text = npy_object_header(3);
  EXPECT_EQ(text.size() % 64, 0u);
  const NpyHeader header = read_npy_header(text);
  EXPECT_EQ(header.element, "|O");
  EXPECT_EQ(header.shape, std::vector<int64_t>{3});
  EXPECT_EQ(header.bytes, text.size());
}

std::string npy(const std::string& dictionary, char version = 1) {
  std::string out = "\x93NUMPY"s + version + '\0' + static_cast<char>(dictionary.size()) + '\0';
  return out + (version > 1 ? "\0\0"s : "") + dictionary;
}

TEST(NpyHeader, OtherFormsAreRead) {
  EXPECT_EQ(read_npy_header(npy("{\"shape\": (), 'fortran_order': True, 'descr': '<f4'}\n", 2)).shape.size(), 0u);
  EXPECT_EQ(read_npy_header(npy("{'descr':'<f4','fortran_order':False,'shape':(2L, 3L)}  \n")).shape,
            (std::vector<int64_t>{2, 3}));
}

TEST(NpyHeader, BadOnesAreRefused) {
  const auto refused = [](const std::string& bytes, const std::string& words) {
    expect_error<Unreadable>([&] { read_npy_header(bytes); }, {words});
  };
  refused("PK", "no .npy array");
  refused("\x93NUMPY\x01", "cut short");
  refused("\x93NUMPY\x04\0\x02\0{}"s, "its .npy version is 4");
  refused("\x93NUMPY\x01\0\xff\xff{}"s, "cut short");
  refused(npy("{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': ()}"), "something else than one element");
  refused(npy("{'descr': '|O', 'fortran_order': 0, 'shape': ()}"), "lacks 'False'");
  refused(npy("{'descr': '|O', 'fortran_order': False, 'shape': (-1,)}"), "not of whole numbers");
  refused(npy("{'descr': '|O', 'fortran_order': False}"), "does not hold descr");
  refused(npy("{'descr': '|O', 'x': 1}"), "the unknown key 'x'");
  refused(npy("{'descr': '|O"), "is cut short");
}

}  // namespace
}  // namespace graupel::io
