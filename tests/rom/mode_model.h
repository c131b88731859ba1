// A model of the deformation alone by smooth modes, for tests, and elastic bodies of two laws that it can move.
#pragma once

#include <cmath>
#include <string>

#include "rom/cubature/quadrature.h"
#include "rom/deformation/mode_deformation.h"
#include "tests/rom/deformation_model.h"

namespace graupel::rom::test {

/// A block that flies and falls, its lower half jelly and its upper half neo-Hookean; `more` are further keys, `width`
/// is along x [m].
inline Scene two_laws_scene(const std::string& more = "", const std::string& width = "0.12") {
  const auto half = [&](const char* place, const char* material) {
    return R"({ "shape": "box", "size": [)" + width + R"(, 0.08, 0.12], "position": [0.5, )" + place +
           R"(, 0.5], "material": ")" + material + R"(", "velocity": [0.5, -0.3, 0] })";
  };
  return io::parse_scene(R"({
    "domain": { "size": [1, 1, 1], "dx": 0.04, "walls": "stick" },
    "materials": { "jelly": { "preset": "jelly", "youngs_modulus": 12500, "poissons_ratio": 0.3 },
                   "rubber": { "preset": "jelly", "model": "neo_hookean", "youngs_modulus": 8000 } },
    "sources": [ )" + half("0.48", "jelly") +
                             ", " + half("0.56", "rubber") + R"( ],
    "time_step": { "policy": "fixed", "substeps_per_frame": 4 }, "gravity": [0, -4, 0],
    "transfer": { "scheme": "pic" }, "frame_time": 0.01, "frames": 6, "seed": 3)" +
                             more + "}",
                         "scene", "");
}

/// Three translations, three shears and stretches, and waves; every n-th particle is a sample.
inline ReducedModel mode_model(const Scene& scene, std::size_t every = 12, int latents = 10) {
  std::vector<double> rest;
  for (int k = 0; k < latents; ++k) rest.push_back(0.1 * std::cos(k));
  const mpm::SampledParticles sampled = mpm::sample_sources(scene, scene.seed);
  std::vector<float> reference;
  std::vector<Vec3f> points;
  for (const Vec3d& x : sampled.position) {
    points.push_back(x.cast<float>());
    reference.insert(reference.end(), points.back().a, points.back().a + 3);
  }
  const ModeLattice lattice = ModeLattice::around(reference, 0.07, Vec3d::zero());
  std::vector<float> nodes;
  for (int k = 0; k < latents; ++k)
    for (int i = 0; i < lattice.count[0]; ++i)
      for (int j = 0; j < lattice.count[1]; ++j)
        for (int l = 0; l < lattice.count[2]; ++l) {
          const Vec3d x = lattice.low + lattice.spacing * Vec3d{double(i), double(j), double(l)} - Vec3d::filled(0.5);
          Vec3d u = Vec3d::zero();
          if (k < 3)
            u[k] = 0.1;
          else if (k < 6)
            u[k - 3] = x[(k + 1) % 3];
          else
            u[k % 3] = 0.02 * std::sin(20 * x[(k + 1) % 3] + 11 * x[(k + 2) % 3] + k);
          for (int c = 0; c < 3; ++c) nodes.push_back(static_cast<float>(u[c]));
        }
  ReducedModel model =
      deformation_model(scene, std::make_shared<const ModeDeformation>(lattice, std::move(nodes), rest), rest);
  model.clusters = make_clusters(points, std::vector<int32_t>(points.size(), 0), 1);
  model.samples.clear();
  for (std::size_t p = 0; p < points.size(); p += every) model.samples.push_back(static_cast<int32_t>(p));
  model.contact_weight = 10;
  return model;
}

}  // namespace graupel::rom::test
