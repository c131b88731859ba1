// A third network in one file: a block of attention between neighbouring particles (Vaswani et al. 2017), as a plan
// with an operation of its own, which the libtorch engine is taught. Layout, initial values, gradient and checkpoints
// are those of every plan.
#include <ATen/ATen.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/math/random.h"
#include "core/system/error.h"
#include "graph/topology/gns_graph.h"
#include "tests/train/gns_cloud.h"
#include "train/networks/torch_engine.h"

namespace graupel::train {
namespace {

constexpr int64_t h = 8;

/// encode, h += attention(h), decode.
graph::LayerPlan attention_plan(const graph::GnsConfig& config) {
  using graph::RowSet;
  graph::LayerPlan plan;
  plan.name = "attention";
  plan.embedding = config.embedding;
  const int64_t features = config.input_width() - config.embedding;
  plan.layers = {{.name = "encoder", .inputs = config.input_width(), .hidden = h, .outputs = h},
                 {.name = "attention", .inputs = h, .hidden = h, .outputs = 3 * h, .hidden_layers = 0},
                 {.name = "decoder", .inputs = h, .hidden = h, .outputs = config.output_width(), .norm = false}};
  plan.inputs = 2;
  const graph::Rows particles{RowSet::particles, 0}, edges{RowSet::edges, 0}, moving{RowSet::moving, 0};
  plan.values = {{particles, features}, {edges, 4},     {particles, h},
                 {particles, 3 * h},    {particles, h}, {moving, config.output_width()}};
  const graph::Links links{graph::LinkKind::particle_neighbors};
  plan.operations = {{.kind = graph::operation::encode, .layer = 0, .sources = {{0}}, .output = 2},
                     {.kind = "project", .layer = 1, .sources = {{2}}, .output = 3},
                     {.kind = "attend", .links = links, .sources = {{3}}, .residual = 2, .output = 4},
                     {.kind = graph::operation::decode, .layer = 2, .sources = {{4}}, .output = 5}};
  plan.stages = {1};
  return plan;
}

void teach(TorchEngine& engine) {
  engine.add_operation("project", [](const TorchEngine::Context& c) {
    return at::addmm(c.parameter(".bias"), c.source(0), c.parameter(".weight").t());
  });
  // softmax over the links of a receiver of q_receiver . k_sender / sqrt(h), times v_sender.
  engine.add_operation("attend", [](const TorchEngine::Context& c) {
    const TorchLinks& links = c.links();
    const at::Tensor sender = links.sender.index.to(at::kLong), receiver = links.receiver.index.to(at::kLong);
    const at::Tensor q = c.source(0).narrow(1, 0, h), k = c.source(0).narrow(1, h, h),
                     v = c.source(0).narrow(1, 2 * h, h);
    const at::Tensor score =
        (q.index_select(0, receiver) * k.index_select(0, sender)).sum(1, true) / std::sqrt(static_cast<double>(h));
    const at::Tensor weight = (score - score.max().detach()).exp();
    const at::Tensor all = at::zeros({q.size(0), 1}, q.options()).index_add(0, receiver, weight);
    const at::Tensor sum =
        at::zeros({q.size(0), h}, q.options()).index_add(0, receiver, weight * v.index_select(0, sender));
    return sum / all;
  });
}

struct Case {
  explicit Case(int64_t checkpoints = 0) : layout(attention_plan(config())) {
    const std::vector<float> values = layout.initial_values(3);
    flat = at::from_blob(const_cast<float*>(values.data()), {layout.size()}, at::kFloat).to(at::kDouble);
    engine = std::make_unique<TorchEngine>(layout, flat, checkpoints);
    batch =
        upload(concatenate({random_cloud(config(), 1, 40, 0.2).scene, random_cloud(config(), 2, 25, 0.3).scene}), flat);
  }
  static graph::GnsConfig config() {
    graph::GnsConfig config;
    config.latent = h;
    config.embedding = 3;
    config.history = 2;
    config.radius = 0.08;
    return config;
  }
  double loss() const { return (engine->forward(batch) - batch.target).square().sum().item().toDouble(); }
  at::Tensor gradient() const {
    at::Tensor gradient = at::zeros_like(flat);
    engine->backward(batch, gradient, [&](const at::Tensor& output) { return 2 * (output - batch.target); });
    return gradient;
  }

  ParameterLayout layout;
  at::Tensor flat;
  std::unique_ptr<TorchEngine> engine;
  DeviceBatch batch;
};

TEST(AttentionBlock, IsAPlanWithTensorsOfItsOwn) {
  const graph::LayerPlan plan = attention_plan(Case::config());
  EXPECT_NO_THROW(plan.check());
  const ParameterLayout layout(plan);
  EXPECT_EQ(layout.find("attention.weight").shape, (std::vector<int64_t>{3 * h, h}));
  const graph::PlanRows rows{.particles = 10, .moving = 10, .level = {{.cells = 0, .edges = 40}}};
  const int64_t features = Case::config().input_width() - Case::config().embedding;
  EXPECT_EQ(flop_of(plan, rows), 2 * 10 * (features * h + h * h + h * 3 * h + h * h + 3 * h));
}

TEST(AttentionBlock, AnEngineThatWasNotTaughtSaysWhatItLacks) {
  const Case c;
  try {
    c.loss();
    ADD_FAILURE();
  } catch (const ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("engine 'libtorch' has no operation 'project', which plan 'attention'"),
              std::string::npos)
        << error.what();
  }
}

TEST(AttentionBlock, GradientAgreesWithFiniteDifferencesWithAndWithoutCheckpoints) {
  for (const int64_t checkpoints : {0, 1}) {
    Case c(checkpoints);
    teach(*c.engine);
    const at::Tensor gradient = c.gradient();
    const Random random(1, RandomPurpose::test, 9);
    for (const Parameter& parameter : c.layout.parameters()) {
      const double scale = gradient.narrow(0, parameter.begin, parameter.count).abs().max().item().toDouble();
      EXPECT_GT(scale, 0) << parameter.name;
      for (uint64_t draw = 0; draw < 4; ++draw) {
        const int64_t i = parameter.begin + random.integer(draw, 0, static_cast<uint32_t>(parameter.count));
        double loss[2];
        for (const int side : {0, 1}) {
          c.flat[i] += side ? 1e-6 : -1e-6;
          loss[side] = c.loss();
          c.flat[i] -= side ? 1e-6 : -1e-6;
        }
        EXPECT_NEAR(gradient[i].item().toDouble(), (loss[1] - loss[0]) / 2e-6, 1e-5 * scale + 1e-6) << parameter.name;
      }
    }
  }
}

TEST(AttentionBlock, Learns) {
  Case c;
  teach(*c.engine);
  const double before = c.loss();
  for (int step = 0; step < 60; ++step) {
    const at::Tensor gradient = c.gradient();
    c.flat.sub_(gradient * (0.02 * std::sqrt(before) / (1e-9 + gradient.norm().item().toDouble())));
  }
  EXPECT_LT(c.loss(), 0.9 * before);
}

}  // namespace
}  // namespace graupel::train
