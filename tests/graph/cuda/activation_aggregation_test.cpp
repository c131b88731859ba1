// Sums of activations on a GPU and the way back beside the formula, item by item in double precision.
#include "graph/cuda/aggregation/activation_aggregation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "core/parallel/buffer.h"
#include "tests/gpu_only.h"
#include "tests/graph/cuda/bf16_rows.h"

namespace graupel::graph {
namespace {

constexpr int h = layer_width;
constexpr double slope = 0.01;

template <typename T>
Buffer<T> on_gpu(const std::vector<T>& values) {
  Buffer<T> buffer(Device::cuda, 0);
  buffer.upload(values);
  return buffer;
}

struct Item {
  int32_t receiver, sender, row;
  double weight;
  std::array<double, 3> offset;
};

/// Items and the numbers of their ends, on both sides.
struct Case {
  Case(std::vector<Item> all, int64_t receivers, int64_t senders)
      : items(std::move(all)),
        sent(random_rows(1, senders)),
        received(random_rows(2, receivers)),
        g(random_rows(3, receivers)),
        table(random_numbers(4, 8 * h)),
        on_sent(on_gpu(sent)),
        on_received(on_gpu(received)),
        on_g(on_gpu(g)),
        on_table(on_gpu(table)),
        sum(Device::cuda, received.size()),
        signs(Device::cuda, items.size() * sign_bytes),
        back_sent(Device::cuda, sent.size()),
        back_received(Device::cuda, received.size()),
        partial(Device::cuda, static_cast<std::size_t>(most_offset_partials()) * 3 * h) {
    for (const Item& item : items) weight.push_back(static_cast<float>(item.weight));
    on_weight = on_gpu(weight);
  }

  std::vector<Item> items;
  std::vector<uint16_t> sent, received, g;
  std::vector<float> table, weight;
  Buffer<uint16_t> on_sent, on_received, on_g;
  Buffer<float> on_table, on_weight;
  Buffer<uint16_t> sum;
  Buffer<uint8_t> signs;
  Buffer<uint16_t> back_sent, back_received;
  Buffer<float> partial;
};

struct Expected {
  std::vector<double> sum, sent, received, offsets;
};
Expected formula(const Case& c, bool has_received, double scale) {
  Expected e{std::vector<double>(c.received.size()), std::vector<double>(c.sent.size()),
             std::vector<double>(c.received.size()), std::vector<double>(3 * h)};
  for (const Item& item : c.items)
    for (int i = 0; i < h; ++i) {
      const auto r = static_cast<std::size_t>(item.receiver * h + i), s = static_cast<std::size_t>(item.sender * h + i);
      const double x = from_bf16(c.sent[s]) + static_cast<double>(c.table[static_cast<std::size_t>(item.row * h + i)]) +
                       (has_received ? from_bf16(c.received[r]) : 0);
      const double factor = scale * item.weight, d = factor * (x > 0 ? 1 : slope) * from_bf16(c.g[r]);
      e.sum[r] += factor * (x > 0 ? x : slope * x);
      e.sent[s] += d;
      e.received[r] += d;
      for (int axis = 0; axis < 3; ++axis)
        e.offsets[static_cast<std::size_t>(axis * h + i)] += d * item.offset[static_cast<std::size_t>(axis)];
    }
  return e;
}

void expect_rows(const Buffer<uint16_t>& actual, const std::vector<double>& expected, const char* what) {
  const std::vector<uint16_t> rows = actual.download();
  ASSERT_EQ(rows.size(), expected.size());
  for (std::size_t i = 0; i < rows.size(); ++i)
    ASSERT_NEAR(from_bf16(rows[i]), expected[i], 4e-3 * std::abs(expected[i]) + 1e-5) << what << " " << i;
}
void expect_offsets(const Case& c, int partials, const std::vector<double>& expected) {
  const std::vector<float> parts = c.partial.download();
  for (std::size_t i = 0; i < expected.size(); ++i) {
    double sum = 0;
    for (int p = 0; p < partials; ++p) sum += static_cast<double>(parts[static_cast<std::size_t>(p) * 3 * h + i]);
    ASSERT_NEAR(sum, expected[i], 1e-4 * (1 + std::abs(expected[i]))) << i;
  }
}

/// Pairs of particles and the corners of random cells, of which a few have hundreds.
struct Pairs {
  static constexpr int32_t particles = 500, cells = 90;
  Pairs() : offset(random_numbers(5, 3 * particles)), begin(cells + 1) {
    const Random random(6, RandomPurpose::test);
    for (int32_t q = 0; q < 8 * particles; ++q) {
      const auto draw = static_cast<uint64_t>(q);
      cell.push_back(static_cast<int32_t>(random.integer(draw, 0, q % 3 == 0 ? 2 : cells - 1)));  // one has none
      pair.push_back(q);
      weight.push_back(random.uniform(draw, 1));
    }
    std::stable_sort(pair.begin(), pair.end(), [&](int32_t a, int32_t b) { return cell[at(a)] < cell[at(b)]; });
    for (const int32_t c : cell) ++begin[at(c) + 1];
    for (std::size_t c = 0; c < cells; ++c) begin[c + 1] += begin[c];
  }
  static std::size_t at(int32_t i) { return static_cast<std::size_t>(i); }
  /// sign (bits - offset)
  std::vector<Item> items(bool to_cells, double sign) const {
    std::vector<Item> items;
    for (int32_t q = 0; q < 8 * particles; ++q) {
      const int32_t p = q / 8, c = cell[at(q)];
      Item item{to_cells ? c : p, to_cells ? p : c, q % 8, static_cast<float>(weight[at(q)]), {}};
      for (int axis = 0; axis < 3; ++axis)
        item.offset[at(axis)] = sign * ((q >> axis & 1) - static_cast<double>(offset[at(3 * p + axis)]));
      items.push_back(item);
    }
    return items;
  }
  std::vector<int32_t> cell, pair;
  std::vector<double> weight;
  std::vector<float> offset;
  std::vector<int32_t> begin;
};

constexpr RowOf by_particle{nullptr, 3, -1};
constexpr RowOf by_corner{nullptr, 0, 7};

TEST(ActivationAggregation, OfParticlesInCellsAndBack) {
  GRAUPEL_NEEDS_GPU();
  const Pairs pairs;
  Case c(pairs.items(true, 1), Pairs::cells, Pairs::particles);
  const Expected expected = formula(c, false, 0.125);
  const auto begin = on_gpu(pairs.begin), pair = on_gpu(pairs.pair), cell = on_gpu(pairs.cell);
  const auto offset = on_gpu(pairs.offset);
  aggregate_activations({.receivers = Pairs::cells,
                         .items = {.begin = begin.data(), .item = pair.data(), .are_long = true},
                         .sender = by_particle,
                         .sent = c.on_sent.data(),
                         .table = c.on_table.data(),
                         .table_row = by_corner,
                         .weight = c.on_weight.data(),
                         .scale = 0.125f,
                         .sum = c.sum.data(),
                         .signs = c.signs.data()},
                        nullptr);
  expect_rows(c.sum, expected.sum, "sum");
  const int partials = sum_gradients(ActivationGradient{.nodes = Pairs::particles,
                                                        .items = {.fixed = 8},
                                                        .g = c.on_g.data(),
                                                        .row = {cell.data()},
                                                        .weight = c.on_weight.data(),
                                                        .scale = 0.125f,
                                                        .signs = c.signs.data(),
                                                        .out = c.back_sent.data(),
                                                        .offset = offset.data(),
                                                        .partial = c.partial.data()},
                                     nullptr);
  expect_rows(c.back_sent, expected.sent, "gradient of the senders");
  expect_offsets(c, partials, expected.offsets);
}

TEST(ActivationAggregation, OfCellsAroundParticlesAndBack) {
  GRAUPEL_NEEDS_GPU();
  const Pairs pairs;
  Case c(pairs.items(false, -1), Pairs::particles, Pairs::cells);
  const Expected expected = formula(c, true, 1);
  const auto begin = on_gpu(pairs.begin), pair = on_gpu(pairs.pair), cell = on_gpu(pairs.cell);
  const auto offset = on_gpu(pairs.offset);
  aggregate_activations({.receivers = Pairs::particles,
                         .items = {.fixed = 8},
                         .sender = {cell.data()},
                         .sent = c.on_sent.data(),
                         .received = c.on_received.data(),
                         .table = c.on_table.data(),
                         .table_row = by_corner,
                         .weight = c.on_weight.data(),
                         .sum = c.sum.data(),
                         .signs = c.signs.data()},
                        nullptr);
  expect_rows(c.sum, expected.sum, "sum");
  const int partials = sum_gradients(ActivationGradient{.nodes = Pairs::particles,
                                                        .items = {.fixed = 8},
                                                        .g = c.on_g.data(),
                                                        .is_receiver = true,
                                                        .weight = c.on_weight.data(),
                                                        .signs = c.signs.data(),
                                                        .out = c.back_received.data(),
                                                        .corner_sign = -1,
                                                        .offset = offset.data(),
                                                        .partial = c.partial.data()},
                                     nullptr);
  expect_rows(c.back_received, expected.received, "gradient of the receivers");
  expect_offsets(c, partials, expected.offsets);
  EXPECT_EQ(sum_gradients(ActivationGradient{.nodes = Pairs::cells,
                                             .items = {.begin = begin.data(), .item = pair.data(), .are_long = true},
                                             .g = c.on_g.data(),
                                             .row = by_particle,
                                             .weight = c.on_weight.data(),
                                             .signs = c.signs.data(),
                                             .out = c.back_sent.data()},
                          nullptr),
            0);
  expect_rows(c.back_sent, expected.sent, "gradient of the senders");
}

TEST(ActivationAggregation, OfNeighborsAndBack) {
  GRAUPEL_NEEDS_GPU();
  // A box of cells with holes
  constexpr int size[3] = {7, 6, 5};
  const Random random(8, RandomPurpose::test);
  std::vector<int32_t> number(7 * 6 * 5, -1), begin{0}, sender, slot;
  const auto place = [&](int x, int y, int z) { return static_cast<std::size_t>((z * size[1] + y) * size[0] + x); };
  int32_t cells = 0;
  for (std::size_t i = 0; i < number.size(); ++i)
    if (random.uniform(i, 0) > 0.2) number[i] = cells++;
  std::vector<Item> items;
  std::map<std::pair<int32_t, int32_t>, int32_t> edge_of;
  for (int z = 0; z < size[2]; ++z)
    for (int y = 0; y < size[1]; ++y)
      for (int x = 0; x < size[0]; ++x) {
        const int32_t to = number[place(x, y, z)];
        if (to < 0) continue;
        for (int s = 0; s < 6; ++s) {
          int n[3] = {x, y, z};
          n[s / 2] += s % 2 ? 1 : -1;
          if (n[s / 2] < 0 || n[s / 2] >= size[s / 2]) continue;
          const int32_t from = number[place(n[0], n[1], n[2])];
          if (from < 0) continue;
          edge_of[{from, to}] = static_cast<int32_t>(items.size());
          sender.push_back(from);
          slot.push_back(s);
          Item item{to, from, s, 1, {}};
          item.offset[static_cast<std::size_t>(s / 2)] = s % 2 ? -1 : 1;  // from sender to receiver
          items.push_back(item);
        }
        begin.push_back(static_cast<int32_t>(items.size()));
      }
  std::vector<int32_t> reverse;
  for (const Item& item : items) reverse.push_back(edge_of.at({item.receiver, item.sender}));
  Case c(items, cells, cells);
  const Expected expected = formula(c, true, 1);
  const auto begins = on_gpu(begin), senders = on_gpu(sender), slots = on_gpu(slot), reverses = on_gpu(reverse);
  aggregate_activations({.receivers = cells,
                         .items = {.begin = begins.data()},
                         .sender = {senders.data()},
                         .sent = c.on_sent.data(),
                         .received = c.on_received.data(),
                         .table = c.on_table.data(),
                         .table_row = {slots.data()},
                         .sum = c.sum.data(),
                         .signs = c.signs.data()},
                        nullptr);
  expect_rows(c.sum, expected.sum, "sum");
  const int partials = sum_gradients(EdgeGradient{.cells = cells,
                                                  .edge_begin = begins.data(),
                                                  .sender = senders.data(),
                                                  .slot = slots.data(),
                                                  .reverse = reverses.data(),
                                                  .g = c.on_g.data(),
                                                  .signs = c.signs.data(),
                                                  .sent = c.back_sent.data(),
                                                  .received = c.back_received.data(),
                                                  .partial = c.partial.data()},
                                     nullptr);
  expect_rows(c.back_sent, expected.sent, "gradient of the senders");
  expect_rows(c.back_received, expected.received, "gradient of the receivers");
  expect_offsets(c, partials, expected.offsets);
}

}  // namespace
}  // namespace graupel::graph
