// Emitters: bodies that send out material during the run.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/body.h"

namespace graupel {

enum class Emission {
  stream,  ///< particles leave the front of the body (seen along `velocity`) one after the other
  burst    ///< the whole body appears at each of `times`
};
template <>
struct EnumWords<Emission> {
  static constexpr std::pair<const char*, Emission> words[] = {{"stream", Emission::stream},
                                                               {"burst", Emission::burst}};
};

struct Emitter : Body {
  Emission emission = Emission::stream;
  std::string material;
  double particles_per_cell = 8;
  Vec3d velocity = {0, 0, 0};        ///< [m/s]
  std::optional<double> rate;        ///< particles [1/s]; default: as many as fill the space that the stream sweeps
  double start_time = 0;             ///< [s]
  double end_time = 1;               ///< [s]
  std::vector<double> times;         ///< [s]
  int64_t particle_limit = 1000000;  ///< an emitter that would send out more is refused

  template <typename Visitor>
  static void fields(Visitor&& visit) {
    using E = Emitter;
    Body::body_fields<E>(visit);
    visit(&E::emission, FieldInfo{.name = "emission", .unit = "", .meaning = "How the material appears"});
    visit(&E::material,
          FieldInfo{.name = "material", .unit = "", .meaning = "Key of the scene's materials", .required = true});
    visit(&E::particles_per_cell, FieldInfo{.name = "particles_per_cell",
                                            .unit = "",
                                            .meaning = "Particles in a grid cell",
                                            .range = {.low = 0, .high = 1000, .low_open = true}});
    visit(&E::velocity,
          FieldInfo{.name = "velocity", .unit = "m/s", .meaning = "Velocity of the new particles; a stream needs one"});
    visit(&E::rate, FieldInfo{.name = "rate",
                              .unit = "1/s",
                              .meaning = "Particles a second; default and upper limit: what fills the space swept",
                              .range = Range::positive(),
                              .only_for = "stream"});
    visit(&E::start_time, FieldInfo{.name = "start_time",
                                    .unit = "s",
                                    .meaning = "When the stream starts",
                                    .range = Range::not_negative(),
                                    .only_for = "stream"});
    visit(&E::end_time, FieldInfo{.name = "end_time",
                                  .unit = "s",
                                  .meaning = "When the stream ends",
                                  .range = Range::positive(),
                                  .required = true,
                                  .only_for = "stream"});
    visit(&E::times, FieldInfo{.name = "times",
                               .unit = "s",
                               .meaning = "When the body appears, in ascending order",
                               .range = Range::not_negative(),
                               .required = true,
                               .only_for = "burst"});
    visit(&E::particle_limit, FieldInfo{.name = "particle_limit",
                                        .unit = "",
                                        .meaning = "Most particles that it may send out in the run",
                                        .range = Range::between(1, 2e9)});
  }
};

}  // namespace graupel
