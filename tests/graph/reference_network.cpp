#include "reference_network.h"

#include <cmath>

#include "reference_layers.h"

namespace graupel::graph {

namespace {

class Reference {
 public:
  Reference(const nn::Weights& weights, const sparsegrid::Hierarchy<3>& hierarchy)
      : layers_(weights, 1, 0.01),
        hierarchy_(hierarchy),
        config_(HgnConfig::from_metadata(weights.metadata, weights.file)),
        h_(static_cast<std::size_t>(config_.latent)) {}

  std::vector<double> run(const std::vector<float>& features, const std::vector<int32_t>& type,
                          const std::vector<Vec<float, 3>>& position) {
    particle_ = layers_.encode("encoder", features, type);
    particle_to_grid(position);
    for (std::size_t l = 0; l < levels(); ++l) {
      if (l > 0) restrict_from(l - 1);
      block("down." + std::to_string(l), l);
    }
    for (std::size_t l = levels() - 1; l-- > 0;) {
      prolong_to(l);
      block("up." + std::to_string(l), l);
    }
    return decode(position);
  }

 private:
  std::size_t levels() const { return static_cast<std::size_t>(config_.levels); }

  Row fcn(const std::string& name, const Row& x) const { return layers_.fcn(name, x); }
  bool sums_activations() const { return config_.aggregation == Aggregation::activations; }

  /// What a receiver sums of one message.
  Row message(const std::string& name, const Row& x) {
    return sums_activations() ? layers_.activated(name + ".gather", x) : fcn(name, x);
  }
  /// What a receiver makes of its sum: nothing more, where the messages are summed.
  Row received(const std::string& name, const Row& sum) { return sums_activations() ? fcn(name, sum) : sum; }

  /// World position of a cell centre, and the spacing of its level.
  Row centre(std::size_t level, std::size_t cell) const {
    Row x(3);
    for (int d = 0; d < 3; ++d)
      x[static_cast<std::size_t>(d)] =
          hierarchy_.origin[d] + (hierarchy_.levels[level].coordinate[cell][d] + 0.5) * spacing(level);
    return x;
  }
  double spacing(std::size_t level) const { return hierarchy_.spacing * static_cast<double>(1 << level); }

  static Row scaled_difference(const Row& a, const Row& b, double scale) {
    return {(a[0] - b[0]) / scale, (a[1] - b[1]) / scale, (a[2] - b[2]) / scale};
  }

  void particle_to_grid(const std::vector<Vec<float, 3>>& position) {
    cell_.resize(levels());
    for (std::size_t l = 0; l < levels(); ++l) cell_[l].assign(hierarchy_.levels[l].size(), Row(h_, 0.0));
    for_each_pair(position, [&](std::size_t p, std::size_t c, double weight, const Row& x) {
      const Row offset = scaled_difference(centre(0, c), x, hierarchy_.spacing);
      add(cell_[0][c], message("particle_to_grid", join({particle_[p], offset})), weight * config_.p2g_scale);
    });
    for (Row& cell : cell_[0]) cell = received("particle_to_grid", cell);
  }

  /// Pairs found from the definition: cells whose trilinear weight prod(1 - |x - centre|/R) is not zero.
  template <typename Body>
  void for_each_pair(const std::vector<Vec<float, 3>>& position, const Body& body) {
    for (std::size_t p = 0; p < position.size(); ++p) {
      const Row x = {position[p][0], position[p][1], position[p][2]};
      for (std::size_t c = 0; c < hierarchy_.levels[0].size(); ++c) {
        const Row u = scaled_difference(x, centre(0, c), hierarchy_.spacing);
        double weight = 1;
        for (const double d : u) weight *= std::max(0.0, 1 - std::abs(d));
        if (weight > 0) body(p, c, weight, x);
      }
    }
  }

  void block(const std::string& name, std::size_t level) {
    Rows& cell = cell_[level];
    std::map<std::pair<std::size_t, std::size_t>, Row> edges;  // (sender, receiver) -> latent
    for (std::size_t i = 0; i < cell.size(); ++i)
      for (std::size_t j = 0; j < cell.size(); ++j) {
        const Row d = scaled_difference(centre(level, j), centre(level, i), spacing(level));
        if (std::abs(std::abs(d[0]) + std::abs(d[1]) + std::abs(d[2]) - 1) < 1e-9) edges[{i, j}] = d;
      }
    for (int64_t k = 0; k < config_.message_passing; ++k) {
      const std::string prefix = name + "." + std::to_string(k);
      Rows sums(cell.size(), Row(h_, 0.0));
      for (auto& [ends, latent] : edges) {
        const Row out = message(sums_activations() ? prefix : prefix + ".edge",
                                join({cell[ends.first], cell[ends.second], latent}));
        add(sums[ends.second], out);
        if (sums_activations()) continue;  // edges keep their direction
        if (k == 0)
          latent = out;
        else
          add(latent, out);
      }
      for (std::size_t j = 0; j < cell.size(); ++j) add(cell[j], fcn(prefix + ".cell", join({sums[j], cell[j]})));
    }
  }

  /// Calls body(fine, coarse) for every cell of `level` and its parent, found by the position of the centres.
  template <typename Body>
  void for_each_child(std::size_t level, const Body& body) {
    for (std::size_t i = 0; i < cell_[level].size(); ++i)
      for (std::size_t j = 0; j < cell_[level + 1].size(); ++j) {
        bool inside = true;
        for (const double d : scaled_difference(centre(level, i), centre(level + 1, j), spacing(level)))
          inside = inside && std::abs(d) < 1;
        if (inside) body(i, j);
      }
  }

  void restrict_from(std::size_t level) {
    const std::string name = "restrict." + std::to_string(level);
    for_each_child(level, [&](std::size_t i, std::size_t j) {
      const Row offset = scaled_difference(centre(level + 1, j), centre(level, i), spacing(level));
      add(cell_[level + 1][j], message(name, join({cell_[level][i], offset})));
    });
    for (Row& cell : cell_[level + 1]) cell = received(name, cell);
  }

  void prolong_to(std::size_t level) {
    for_each_child(level, [&](std::size_t i, std::size_t j) {
      const Row offset = scaled_difference(centre(level, i), centre(level + 1, j), spacing(level));
      add(cell_[level][i],
          fcn("prolong." + std::to_string(level), join({cell_[level + 1][j], cell_[level][i], offset})));
    });
  }

  std::vector<double> decode(const std::vector<Vec<float, 3>>& position) {
    Rows sum(particle_.size(), Row(h_, 0.0));
    for_each_pair(position, [&](std::size_t p, std::size_t c, double weight, const Row& x) {
      const Row offset = scaled_difference(x, centre(0, c), hierarchy_.spacing);
      add(sum[p], message("grid_to_particle", join({cell_[0][c], particle_[p], offset})), weight);
    });
    for (std::size_t p = 0; p < sum.size(); ++p)
      add(particle_[p], sums_activations() ? fcn("grid_to_particle", join({sum[p], particle_[p]})) : sum[p]);
    return layers_.decode(particle_);
  }

  ReferenceLayers layers_;
  const sparsegrid::Hierarchy<3>& hierarchy_;
  HgnConfig config_;
  std::size_t h_;
  Rows particle_;
  std::vector<Rows> cell_;
};

}  // namespace

std::vector<double> reference_forward(const nn::Weights& weights, const std::vector<float>& features,
                                      const std::vector<int32_t>& particle_type,
                                      const sparsegrid::Hierarchy<3>& hierarchy,
                                      const std::vector<Vec<float, 3>>& position) {
  return Reference(weights, hierarchy).run(features, particle_type, position);
}

}  // namespace graupel::graph
