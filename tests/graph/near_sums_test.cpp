// Sums of activations over near particles and the way back, beside the formula in double precision: what the lanes of
// the kernels do, on the host, and the kernels.
#include "graph/cuda/near_sums.h"

#include <gtest/gtest.h>

#include <cmath>

#include "graph/cuda/near_lanes.h"
#include "graph/gns_graph.h"
#include "sparsegrid/radius_graph.h"
#include "tests/gpu_only.h"
#include "tests/graph/bf16_rows.h"
#ifdef GRAUPEL_HAVE_CUDA
#include "core/buffer.h"
#include "graph/cuda/activation_sums.h"
#endif

namespace graupel::graph {
namespace {

constexpr int h = layer_width;
constexpr double slope = 0.01;
constexpr float scale = 0.125f;
constexpr int stride = 2 * h + 4;  // W is the end of a wider matrix

/// A cloud, dense in the middle, with a particle far from all others.
struct Cloud {
  explicit Cloud(int particles)
      : n(particles),
        sent(random_rows(1, n)),
        received(random_rows(2, n)),
        g(random_rows(3, n)),
        weight(random_numbers(4, static_cast<std::size_t>(h * stride))) {
    const std::vector<float> at = random_numbers(5, static_cast<std::size_t>(3 * n));
    std::vector<Vec3f> x;
    for (std::size_t p = 0; p < static_cast<std::size_t>(n); ++p) {
      const auto coordinate = [&](std::size_t d) { return at[3 * p + d] * std::abs(at[3 * p + d]); };
      x.push_back({coordinate(0), coordinate(1), coordinate(2)});
    }
    x[7] = {3, 3, 3};
    constexpr double radius = 0.2;
    const auto graph = sparsegrid::build_radius_graph(x, radius, sparsegrid::SelfEdges::with);
    begin = graph.begin;
    sender = graph.sender;
    reverse.resize(sender.size());
    for (int32_t r = 0; r < n; ++r)
      for (int32_t q = begin[at_(r)]; q < begin[at_(r) + 1]; ++q) {
        const int32_t s = sender[at_(q)];
        receiver.push_back(r);
        for (int32_t back = begin[at_(s)]; back < begin[at_(s) + 1]; ++back)
          if (sender[at_(back)] == r) reverse[at_(q)] = back;
        for (const float f : edge_features(x[at_(s)], x[at_(r)], radius)) features.push_back(f);
      }
  }
  static std::size_t at_(int64_t i) { return static_cast<std::size_t>(i); }
  int64_t links() const { return static_cast<int64_t>(sender.size()); }

  int32_t n;
  std::vector<uint16_t> sent, received, g;
  std::vector<float> weight, features;
  std::vector<int32_t> begin, sender, receiver, reverse;
};

struct Sums {
  explicit Sums(std::size_t rows) : sum(rows), sent(rows), received(rows), weight(4 * h) {}
  Sums() = default;
  std::vector<double> sum, sent, received, weight;
};
/// The formula, and by how much gradients may be off where an activation is so near to its kink that rounding decides.
struct Expected {
  Sums value, slack;
};
Expected formula(const Cloud& c) {
  constexpr double kink = 1e-5;
  const std::size_t rows = c.sent.size();
  Expected e{Sums(rows), Sums(rows)};
  for (std::size_t q = 0; q < c.sender.size(); ++q)
    for (std::size_t i = 0; i < h; ++i) {
      const std::size_t r = Cloud::at_(c.receiver[q]) * h + i, s = Cloud::at_(c.sender[q]) * h + i;
      double x = from_bf16(c.sent[s]) + from_bf16(c.received[r]);
      for (std::size_t f = 0; f < 4; ++f)
        x += static_cast<double>(c.weight[i * stride + f]) * static_cast<double>(c.features[4 * q + f]);
      const double g = static_cast<double>(scale) * from_bf16(c.g[r]);
      e.value.sum[r] += static_cast<double>(scale) * (x > 0 ? x : slope * x);
      const auto add = [&](Sums& to, double d, bool absolute) {
        to.sent[s] += d;
        to.received[r] += d;
        for (std::size_t f = 0; f < 4; ++f) {
          const auto feature = static_cast<double>(c.features[4 * q + f]);
          to.weight[f * h + i] += d * (absolute ? std::abs(feature) : feature);
        }
      };
      add(e.value, x > 0 ? g : slope * g, false);
      if (std::abs(x) < kink) add(e.slack, (1 - slope) * std::abs(g), true);
    }
  return e;
}

void expect_rows(const std::vector<double>& actual, const Expected& expected, std::vector<double> Sums::*part,
                 double tolerance, const char* what) {
  const std::vector<double>&value = expected.value.*part, &slack = expected.slack.*part;
  ASSERT_EQ(actual.size(), value.size());
  for (std::size_t i = 0; i < actual.size(); ++i)
    ASSERT_NEAR(actual[i], value[i], slack[i] + tolerance * (1 + std::abs(value[i]))) << what << " " << i;
}

TEST(NearSums, LanesSumActivationsAndGoBack) {
  const Cloud c(200);
  ASSERT_GT(c.links(), 3 * c.n);
  std::vector<uint8_t> signs(Cloud::at_(c.links()) * near::sign_lanes);
  const NearLinks links{c.n, c.links(), c.begin.data(), c.sender.data(), c.reverse.data(), c.features.data()};
  const NearSums sums{.links = links,
                      .sent = c.sent.data(),
                      .received = c.received.data(),
                      .weight = c.weight.data(),
                      .stride = stride,
                      .scale = scale,
                      .sum = nullptr,
                      .signs = signs.data()};
  const NearGradient back{.links = links,
                          .g = c.g.data(),
                          .scale = scale,
                          .signs = signs.data(),
                          .sent = nullptr,
                          .received = nullptr,
                          .partial = nullptr};
  Sums made;
  const std::size_t rows = c.sent.size();
  for (std::vector<double>* all : {&made.sum, &made.sent, &made.received}) all->resize(rows);
  made.weight.resize(4 * h);
  for (int lane = 0; lane < near::sign_lanes; ++lane) {
    const near::LaneWeights weights(sums, lane);
    for (int64_t n = 0; n < c.n; ++n) {
      float sum[near::columns];
      near::sum_links(sums, weights, n, lane, sum);
      for (int i = 0; i < near::columns; ++i)
        made.sum[Cloud::at_(n * h + lane * near::columns + i)] = static_cast<double>(sum[i]);
    }
  }
  for (int lane = 0; lane < near::sign_lanes; ++lane) {
    float weight[near::features][near::columns] = {};
    for (int64_t n = 0; n < c.n; ++n) {
      float sent[near::columns], received[near::columns];
      near::sum_link_gradients(back, n, lane, sent, received, weight);
      for (int i = 0; i < near::columns; ++i) {
        made.sent[Cloud::at_(n * h + lane * near::columns + i)] = static_cast<double>(sent[i]);
        made.received[Cloud::at_(n * h + lane * near::columns + i)] = static_cast<double>(received[i]);
      }
    }
    for (int f = 0; f < near::features; ++f)
      for (int i = 0; i < near::columns; ++i)
        made.weight[Cloud::at_(f * h + lane * near::columns + i)] = static_cast<double>(weight[f][i]);
  }
  const Expected expected = formula(c);
  expect_rows(made.sum, expected, &Sums::sum, 1e-5, "sum");
  expect_rows(made.sent, expected, &Sums::sent, 1e-5, "gradient of the senders");
  expect_rows(made.received, expected, &Sums::received, 1e-5, "gradient of the receivers");
  expect_rows(made.weight, expected, &Sums::weight, 1e-4, "gradient of the weights");
}

#ifdef GRAUPEL_HAVE_CUDA
template <typename T>
Buffer<T> on_gpu(const std::vector<T>& values) {
  Buffer<T> buffer(Device::cuda, 0);
  buffer.upload(values);
  return buffer;
}
std::vector<double> numbers(const Buffer<uint16_t>& rows) {
  std::vector<double> all;
  for (const uint16_t x : rows.download()) all.push_back(from_bf16(x));
  return all;
}

TEST(NearSums, KernelsSumActivationsAndGoBack) {
  GRAUPEL_NEEDS_GPU();
  const Cloud c(5000);  // more than all blocks take at once
  const auto begin = on_gpu(c.begin), sender = on_gpu(c.sender), reverse = on_gpu(c.reverse);
  const auto features = on_gpu(c.features), weight = on_gpu(c.weight);
  const auto sent = on_gpu(c.sent), received = on_gpu(c.received), g = on_gpu(c.g);
  Buffer<uint16_t> sum(Device::cuda, c.sent.size()), back_sent(Device::cuda, c.sent.size()),
      back_received(Device::cuda, c.sent.size());
  Buffer<uint8_t> signs(Device::cuda, Cloud::at_(c.links()) * sign_bytes);
  Buffer<float> partial(Device::cuda, Cloud::at_(most_offset_partials()) * 4 * h);
  const NearLinks links{c.n, c.links(), begin.data(), sender.data(), reverse.data(), features.data()};
  sum_near({.links = links,
            .sent = sent.data(),
            .received = received.data(),
            .weight = weight.data(),
            .stride = stride,
            .scale = scale,
            .sum = sum.data(),
            .signs = signs.data()},
           nullptr);
  const int partials = sum_gradients(NearGradient{.links = links,
                                                  .g = g.data(),
                                                  .scale = scale,
                                                  .signs = signs.data(),
                                                  .sent = back_sent.data(),
                                                  .received = back_received.data(),
                                                  .partial = partial.data()},
                                     nullptr);
  const Expected expected = formula(c);
  expect_rows(numbers(sum), expected, &Sums::sum, 4e-3, "sum");
  expect_rows(numbers(back_sent), expected, &Sums::sent, 4e-3, "gradient of the senders");
  expect_rows(numbers(back_received), expected, &Sums::received, 4e-3, "gradient of the receivers");
  ASSERT_LE(partials, most_offset_partials());
  const std::vector<float> parts = partial.download();
  std::vector<double> of_weight(4 * h);
  for (int p = 0; p < partials; ++p)
    for (std::size_t i = 0; i < of_weight.size(); ++i)
      of_weight[i] += static_cast<double>(parts[static_cast<std::size_t>(p) * 4 * h + i]);
  expect_rows(of_weight, expected, &Sums::weight, 1e-3, "gradient of the weights");
}
#endif

}  // namespace
}  // namespace graupel::graph
