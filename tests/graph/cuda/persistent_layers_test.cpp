// Networks over rows in one launch: those of a plain evaluation on the host.
#include "graph/cuda/persistent/persistent_layers.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <string>
#include <utility>

#include "core/parallel/buffer.h"
#include "graph/cuda/aggregation/pair_aggregation.h"
#include "graph/cuda/persistent/persistent_weights.h"
#include "tests/gpu_only.h"
#include "tests/graph/cuda/persistent_case.h"

namespace graupel::graph {
namespace {

template <typename T>
Buffer<T> on_gpu(const std::vector<T>& values) {
  Buffer<T> buffer(Device::cuda, 0);
  buffer.upload(values);
  return buffer;
}
std::vector<uint16_t> bits(const Numbers& values) {
  std::vector<uint16_t> all;
  for (const float x : values) all.push_back(nn::bf16_from_float(x));
  return all;
}
Numbers numbers(const std::vector<uint16_t>& bits) {
  Numbers all;
  for (const uint16_t x : bits) all.push_back(nn::float_from_bf16(x));
  return all;
}

/// A network of two operands with two epilogues, or a decoder, and everything that it reads.
struct Case {
  Gather gather;
  int64_t rows, sources, first_link;
  bool decoder;

  Numbers source, own, table, x, weight, vectors, addend, add, matrices;
  std::vector<int32_t> link, begin, pair_row, addend_row, range;
  float scale = 0.25f;

  Case(Gather kind, int64_t row_count, bool with_decoder)
      : gather(kind), rows(row_count), sources(row_count + 5), first_link(3), decoder(with_decoder) {
    Draws draws(static_cast<uint64_t>(row_count) + 100 * static_cast<uint64_t>(kind));
    source = draws.rounded_numbers(sources * h, 1);
    own = draws.rounded_numbers(rows * h, 1);
    table = draws.numbers(8 * h, 1);
    x = draws.numbers(sources * h, 1);
    add = draws.numbers(rows * h, 1);
    vectors = draws.numbers(vectors_of_network * h, 0.2);
    for (int k = 0; k < h; ++k) vectors[static_cast<std::size_t>(norm_scale * h + k)] += 1;
    matrices = draws.rounded_numbers(5 * h * h, 0.15);
    addend = draws.numbers(8 * h, 1);
    const int64_t all = rows + first_link;
    addend_row = draws.links(all, 8, false);
    const int slots = gather == Gather::links ? 6 : gather == Gather::rows ? 1 : 8;
    link = draws.links(slots * all, sources, gather == Gather::links || gather == Gather::children);
    weight = draws.numbers(8 * sources, 0.5, 0.5);
    if (gather == Gather::pairs) list_pairs(draws, all);
    range = {static_cast<int32_t>(first_link), static_cast<int32_t>(all)};
  }

  /// Lists of none, few and many pairs, each pair in one at most.
  void list_pairs(Draws& draws, int64_t all) {
    std::vector<int32_t> left(static_cast<std::size_t>(8 * sources));
    std::iota(left.begin(), left.end(), 0);
    for (std::size_t i = left.size(); i-- > 1;)
      std::swap(left[i], left[static_cast<std::size_t>(draws.links(1, static_cast<int64_t>(i) + 1, false)[0])]);
    link.clear();
    begin.push_back(0);
    pair_row.assign(left.size(), 0);
    for (int64_t r = 0; r < all; ++r) {
      const std::size_t wanted = r % 7 == 0 ? 0 : r == 5 ? 200 : r % 5 == 0 ? 33 : static_cast<std::size_t>(r % 5);
      for (std::size_t k = 0; k < wanted && !left.empty(); ++k) {
        pair_row[static_cast<std::size_t>(left.back())] = static_cast<int32_t>(std::max<int64_t>(r - first_link, 0));
        link.push_back(left.back());
        left.pop_back();
      }
      begin.push_back(static_cast<int32_t>(link.size()));
    }
    if (link.empty()) link.push_back(0);
  }

  static float at(const Numbers& rows_of, int64_t row, int column) {
    return rows_of[static_cast<std::size_t>(row * h + column)];
  }
  float message(int64_t from, int64_t row, int slot, int k) const {
    return activated(at(source, from, k) + (gather == Gather::pairs ? 0 : at(own, row, k)) + at(table, slot, k));
  }
  float gathered(int64_t row, int k) const {
    const int64_t link_row = first_link + row;
    const auto linked = [&](int64_t i) { return link[static_cast<std::size_t>(i)]; };
    float sum = 0;
    if (gather == Gather::rows) return at(x, linked(link_row), k);
    if (gather == Gather::pairs) {
      for (int32_t i = begin[static_cast<std::size_t>(link_row)]; i < begin[static_cast<std::size_t>(link_row + 1)];
           ++i)
        sum += weight[static_cast<std::size_t>(linked(i))] * message(linked(i) / 8, row, linked(i) % 8, k);
      return scale * sum;
    }
    const int slots = gather == Gather::links ? 6 : 8;
    for (int slot = 0; slot < slots; ++slot) {
      const int64_t i = slots * link_row + slot;
      if (linked(i) < 0) continue;
      sum += (gather == Gather::corners ? weight[static_cast<std::size_t>(i)] : 1) * message(linked(i), row, slot, k);
    }
    return scale * sum;
  }
  float vector(int which, int k) const { return at(vectors, which, k); }
  Numbers product(int tile, const Numbers& row) const {
    Numbers out(h, 0.0f), operand;
    for (const float x_k : row) operand.push_back(rounded(x_k));
    for (int r = 0; r < h; ++r)
      for (int k = 0; k < h; ++k)
        out[static_cast<std::size_t>(r)] += at(matrices, tile * h + r, k) * operand[static_cast<std::size_t>(k)];
    return out;
  }

  struct Result {
    Numbers sum, out[2], decoded;
  };
  /// f = LayerNorm(W2 hidden + b2).
  void normalized(const Numbers& hidden, Numbers& f) const {
    Numbers y = product(2, hidden);
    double mean = 0, squares = 0;
    for (int k = 0; k < h; ++k) mean += (y[static_cast<std::size_t>(k)] += vector(bias2, k)) / h;
    for (const float v : y) squares += (v - mean) * (v - mean) / h;
    for (int k = 0; k < h; ++k)
      f[static_cast<std::size_t>(k)] =
          static_cast<float>((y[static_cast<std::size_t>(k)] - mean) / std::sqrt(squares + 1e-5)) *
              vector(norm_scale, k) +
          vector(norm_shift, k);
  }
  void evaluate(int64_t row, Result& result) const {
    Numbers s(h), second(h), hidden(h), f(h);
    for (int k = 0; k < h; ++k) {
      s[static_cast<std::size_t>(k)] = gathered(row, k);
      second[static_cast<std::size_t>(k)] = at(x, row, k);
    }
    const Numbers a = product(0, s), b = product(1, second);
    for (int k = 0; k < h; ++k) {
      const auto i = static_cast<std::size_t>(k);
      hidden[i] = activated(a[i] + b[i] + vector(bias1, k) +
                            at(addend, addend_row[static_cast<std::size_t>(first_link + row)], k));
    }
    normalized(hidden, f);
    for (int k = 0; k < h; ++k) result.sum.push_back(f[static_cast<std::size_t>(k)] += at(add, row, k));
    for (int j = 0; j < 2; ++j) {
      Numbers out = product(3 + j, f);
      for (int k = 0; k < h; ++k) result.out[j].push_back(out[static_cast<std::size_t>(k)] + vector(out_bias0 + j, k));
    }
    for (int d = 0; d < 3; ++d) {
      float sum = 0.5f;
      for (int k = 0; k < h; ++k)
        sum += vector(out_bias1 + d, k) * activated(result.out[0][static_cast<std::size_t>(row * h + k)]);
      result.decoded.push_back(sum);
    }
  }
};

/// Runs a case twice in one launch: the second network's rows are the first one's, so that it has to wait for it.
Case::Result run_on_gpu(const Case& c, bool overflows = false) {
  std::vector<uint16_t> packed(5 * tile_numbers);
  for (int t = 0; t < 5; ++t)
    pack_persistent_tile(c.matrices.data() + t * h * h, h, h, packed.data() + t * tile_numbers);
  const auto source = on_gpu(bits(c.source)), own = on_gpu(bits(c.own)), tiles = on_gpu(packed);
  const auto table = on_gpu(c.table), x = on_gpu(c.x), weight = on_gpu(c.weight), vectors = on_gpu(c.vectors),
             addend = on_gpu(c.addend), add = on_gpu(c.add);
  const auto link = on_gpu(c.link), begin = on_gpu(c.begin), addend_row = on_gpu(c.addend_row), range = on_gpu(c.range);
  Buffer<float> sum(Device::cuda, c.add.size()), decoded(Device::cuda, static_cast<std::size_t>(3 * c.rows));
  Buffer<uint16_t> out0(Device::cuda, c.add.size()), out1(Device::cuda, c.add.size());
  const auto pair_row = on_gpu(c.pair_row);
  Buffer<float> part_sums(Device::cuda, static_cast<std::size_t>(
                                            rows_of_pair_aggregation(c.rows, static_cast<int64_t>(c.link.size())) * h));
  Buffer<int32_t> fault(Device::cuda, 1), overflow(Device::cuda, 1);
  Buffer<uint32_t> done(Device::cuda, 2);
  for (auto* buffer : {&sum, &decoded}) buffer->fill_zero();
  for (auto* buffer : {&out0, &out1}) buffer->fill_zero();
  done.fill_zero();
  overflow.upload({overflows});

  PersistentLayer n{};
  n.range = range.data();
  n.most_rows = static_cast<int32_t>(c.rows);
  n.gather = c.gather;
  n.source = source.data();
  n.own = c.gather == Gather::pairs ? nullptr : own.data();
  n.table = table.data();
  n.rows32 = c.gather == Gather::pairs ? part_sums.data() : x.data();
  n.link = link.data();
  n.begin = begin.data();
  n.weight = weight.data();
  n.scale = c.scale;
  n.second = x.data();
  n.operands = 2;
  n.addend = addend.data();
  n.addend_row = addend_row.data();
  n.tiles = tiles.data();
  n.vectors = vectors.data();
  n.add32 = add.data();
  n.sum32 = sum.data();
  n.epilogues = c.decoder ? 1 : 2;
  n.out[0] = out0.data();
  n.out[1] = out1.data();
  for (float& bias : n.decoder_bias) bias = 0.5f;
  if (c.decoder) n.decoded = decoded.data();
  const auto networks = on_gpu(std::vector<PersistentLayer>{n, n});
  if (c.gather == Gather::pairs)
    aggregate_pairs({range.data(),
                     n.most_rows,
                     overflow.data(),
                     begin.data(),
                     link.data(),
                     pair_row.data(),
                     weight.data(),
                     source.data(),
                     table.data(),
                     part_sums.data(),
                     {}},
                    static_cast<int64_t>(c.link.size()), nullptr);
  run_networks({networks.data(), done.data(), overflow.data(), fault.data()}, {c.rows, c.rows}, nullptr);
  Case::Result result{sum.download(), {numbers(out0.download()), numbers(out1.download())}, decoded.download()};
  EXPECT_EQ(fault.download()[0], overflows);
  return result;
}

void expect_near(const Numbers& actual, const Numbers& expected, double limit, const std::string& what) {
  ASSERT_EQ(actual.size(), expected.size());
  double squares = 0, size = 0, most = 0;
  for (std::size_t i = 0; i < actual.size(); ++i) {
    squares += std::pow(actual[i] - expected[i], 2);
    size += std::pow(expected[i], 2);
    most = std::max(most, static_cast<double>(std::abs(actual[i] - expected[i])));
  }
  EXPECT_LT(std::sqrt(squares / size), limit) << what;
  EXPECT_LT(most, 20 * limit * std::sqrt(size / static_cast<double>(actual.size()))) << what;
}

TEST(WideRows, NetworksAreThoseOfTheHost) {
  GRAUPEL_NEEDS_GPU();
  for (const Gather gather : {Gather::links, Gather::children, Gather::corners, Gather::pairs, Gather::rows})
    for (const int64_t rows : {1, 37, 2500}) {  // the last one by blocks that read their tiles anew
      const Case c(gather, rows, false);
      const std::string name = std::to_string(static_cast<int>(gather)).append(" ").append(std::to_string(rows));
      Case::Result expected;
      for (int64_t row = 0; row < rows; ++row) c.evaluate(row, expected);
      const Case::Result actual = run_on_gpu(c);
      expect_near(actual.sum, expected.sum, 3e-3, name);
      for (int j = 0; j < 2; ++j) expect_near(actual.out[j], expected.out[j], 1e-2, name);
    }
}

TEST(WideRows, ManyRowsAndADecoder) {
  GRAUPEL_NEEDS_GPU();
  const Case c(Gather::corners, 9001, true);
  Case::Result expected;
  for (int64_t row = 0; row < c.rows; ++row) c.evaluate(row, expected);
  const Case::Result actual = run_on_gpu(c);
  expect_near(actual.sum, expected.sum, 3e-3, "sum");
  expect_near(actual.decoded, expected.decoded, 1e-2, "decoded");
  EXPECT_EQ(run_on_gpu(c).decoded, actual.decoded) << "the same every time";
}

/// An encoder: features of one and of two tiles, what a type adds, and epilogues with positions in cells.
TEST(WideRows, FeaturesAndPositionsAreThoseOfTheHost) {
  GRAUPEL_NEEDS_GPU();
  for (const auto& [width, rows] : {std::pair{28, 37}, {61, 37}, {28, 2500}}) {
    Case c(Gather::features, rows, false);
    Draws draws(9);
    const Numbers features = draws.numbers(rows * width, 1), first = draws.numbers(h * width, 0.3),
                  position = draws.numbers(3 * rows, 1, 1), offset_weight = draws.numbers(2 * 3 * h, 1);
    const int operands = feature_tiles(width);
    std::vector<uint16_t> packed(static_cast<std::size_t>(operands + 3) * tile_numbers);
    pack_feature_tiles(first.data(), width, width, packed.data());
    for (int t = 0; t < 3; ++t)
      pack_persistent_tile(c.matrices.data() + (2 + t) * h * h, h, h, packed.data() + (operands + t) * tile_numbers);
    const auto tiles = on_gpu(packed);
    const auto x = on_gpu(features), vectors = on_gpu(c.vectors), addend = on_gpu(c.addend), at = on_gpu(position),
               axes = on_gpu(offset_weight);
    const auto addend_row = on_gpu(c.addend_row), range = on_gpu(c.range);
    Buffer<float> sum(Device::cuda, c.add.size());
    Buffer<uint16_t> out0(Device::cuda, c.add.size()), out1(Device::cuda, c.add.size());
    Buffer<uint32_t> done(Device::cuda, 1);
    done.fill_zero();
    PersistentLayer n{};
    n.range = range.data();
    n.most_rows = rows;
    n.gather = Gather::features;
    n.rows32 = x.data();
    n.width = width;
    n.operands = operands;
    n.addend = addend.data();
    n.addend_row = addend_row.data();
    n.tiles = tiles.data();
    n.vectors = vectors.data();
    n.sum32 = sum.data();
    n.epilogues = 2;
    n.out[0] = out0.data();
    n.out[1] = out1.data();
    n.offset = {at.data(), {0.1, 0.2, 0.3}, 1 / 0.035, axes.data()};
    const auto networks = on_gpu(std::vector<PersistentLayer>{n});
    run_networks({networks.data(), done.data(), nullptr, nullptr}, {rows}, nullptr);

    Case::Result expected;
    for (int64_t row = 0; row < rows; ++row) {
      Numbers hidden(h), f(h);
      for (int k = 0; k < h; ++k) {
        float before = c.vector(bias1, k) + Case::at(c.addend, c.addend_row[static_cast<std::size_t>(3 + row)], k);
        for (int i = 0; i < width; ++i)
          before +=
              first[static_cast<std::size_t>(k * width + i)] * features[static_cast<std::size_t>(row * width + i)];
        hidden[static_cast<std::size_t>(k)] = activated(before);
      }
      c.normalized(hidden, f);
      expected.sum.insert(expected.sum.end(), f.begin(), f.end());
      for (int j = 0; j < 2; ++j) {
        Numbers out = c.product(3 + j, f);
        for (int k = 0; k < h; ++k) {
          float value = out[static_cast<std::size_t>(k)] + c.vector(out_bias0 + j, k);
          for (int d = 0; d < 3; ++d) {
            const double u =
                (static_cast<double>(position[static_cast<std::size_t>(3 * row + d)]) - 0.1 * (d + 1)) / 0.035 - 0.5;
            value += static_cast<float>(u - std::floor(u)) * Case::at(offset_weight, 3 * j + d, k);
          }
          expected.out[j].push_back(value);
        }
      }
    }
    expect_near(sum.download(), expected.sum, 3e-3, std::to_string(width));
    expect_near(numbers(out0.download()), expected.out[0], 1e-2, std::to_string(width));
    expect_near(numbers(out1.download()), expected.out[1], 1e-2, std::to_string(width));
  }
}

TEST(WideRows, DoesNothingWhereTheGridHasOverflowed) {
  GRAUPEL_NEEDS_GPU();
  const Case c(Gather::links, 100, false);
  for (const float x : run_on_gpu(c, true).sum) EXPECT_EQ(x, 0);
}

}  // namespace
}  // namespace graupel::graph
