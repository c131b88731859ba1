// Hyper-parameters of the graph network simulator (GNS, Sanchez-Gonzalez et al. 2020), kept in the weights file's
// metadata.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "graph/config/feature_config.h"

namespace graupel::graph {

/// Values of the metadata keys "architecture" and "format_version" of a weights file.
inline constexpr const char* gns_architecture = "gns";
inline constexpr const char* gns_format_version = "1";

/// Defaults are those of the HGN paper's comparison (section 4), which gives GNS one hidden layer and HGN's obstacle
/// features. GNS itself has two hidden layers and obstacles made of particles: hidden_layers = 2, obstacle_particles =
/// true, cell_normal = false. docs/decisions/ settles what the papers leave open.
struct GnsConfig : FeatureConfig {
  int64_t latent = 128;                 ///< H
  int64_t hidden_layers = 1;            ///< of every fully connected network
  int64_t message_passing = 10;         ///< M
  double radius = 0.035;                ///< R [m]
  double leaky_slope = 0;               ///< of the activation
  bool obstacle_particles = false;      ///< particles of type obstacle_particle_type on the obstacles' surfaces
  double obstacle_spacing = 1.0 / 128;  ///< least distance between them [m]

  /// How far an obstacle particle may be from every other particle and still change its acceleration [m].
  double receptive_field() const { return radius * static_cast<double>(message_passing); }

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using C = GnsConfig;
    visit(&C::latent,
          FieldInfo{
              .name = "latent", .unit = "", .meaning = "Latent and hidden width", .range = Range::between(8, 1024)});
    visit(&C::hidden_layers, FieldInfo{.name = "hidden_layers",
                                       .unit = "",
                                       .meaning = "Hidden layers of every fully connected network",
                                       .range = Range::between(1, 4)});
    visit(
        &C::message_passing,
        FieldInfo{
            .name = "message_passing", .unit = "", .meaning = "Message-passing steps", .range = Range::between(1, 64)});
    visit(&C::radius, FieldInfo{.name = "radius",
                                .unit = "m",
                                .meaning = "Particles this close are neighbours",
                                .range = Range::positive()});
    visit(&C::leaky_slope, FieldInfo{.name = "leaky_slope",
                                     .unit = "",
                                     .meaning = "Slope of the activation below zero; 0 is ReLU",
                                     .range = {.low = 0, .high = 1, .high_open = true}});
    visit(&C::obstacle_particles,
          FieldInfo{.name = "obstacle_particles", .unit = "", .meaning = "Obstacles are particles in the graph"});
    visit(&C::obstacle_spacing, FieldInfo{.name = "obstacle_spacing",
                                          .unit = "m",
                                          .meaning = "Least distance between obstacle particles",
                                          .range = Range::positive()});
    FeatureConfig::fields(visit);
  }

  /// To and from safetensors metadata ("gns.latent" = "128" ..., with "architecture" and "format_version"). Reading
  /// throws InputError naming `file`, key and value when a key is missing, unknown, unreadable or out of range.
  std::map<std::string, std::string> to_metadata() const;
  static GnsConfig from_metadata(const std::map<std::string, std::string>& metadata, const std::string& file);
};

}  // namespace graupel::graph
