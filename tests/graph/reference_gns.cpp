#include "reference_gns.h"

#include "graph/config/gns_config.h"
#include "reference_layers.h"

namespace graupel::graph {

std::vector<double> reference_gns(const nn::Weights& weights, const std::vector<float>& features,
                                  const std::vector<int32_t>& particle_type, const std::vector<Vec3f>& position) {
  const GnsConfig config = GnsConfig::from_metadata(weights.metadata, weights.file);
  const ReferenceLayers network(weights, config.hidden_layers, config.leaky_slope);
  const std::size_t n = position.size();
  Rows node = network.encode("encoder.node", features, particle_type);
  std::map<std::pair<std::size_t, std::size_t>, Row> edge;  // (sender, receiver)
  for (std::size_t s = 0; s < n; ++s)
    for (std::size_t r = 0; r < n; ++r) {
      const Vec3d d = (position[s].cast<double>() - position[r].cast<double>()) * (1 / config.radius);
      if (norm(d) <= 1) edge[{s, r}] = network.fcn("encoder.edge", {d[0], d[1], d[2], norm(d)});
    }
  for (int64_t k = 0; k < config.message_passing; ++k) {
    const std::string step = "step." + std::to_string(k);
    Rows received(n, Row(static_cast<std::size_t>(config.latent), 0.0));
    for (auto& [ends, latent] : edge) {
      const Row out = network.fcn(step + ".edge", join({node[ends.first], node[ends.second], latent}));
      add(received[ends.second], out);
      add(latent, out);
    }
    for (std::size_t i = 0; i < n; ++i) add(node[i], network.fcn(step + ".node", join({received[i], node[i]})));
  }
  return network.decode(node);
}

}  // namespace graupel::graph
