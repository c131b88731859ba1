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
    Body::body_fields<E>(visit, "box half_box sphere half_sphere cone pyramid cylinder mesh");
    visit(&E::emission, FieldInfo{"emission", "", "How the material appears"});
    visit(&E::material, FieldInfo{"material", "", "Key of the scene's materials"}.mandatory());
    visit(&E::particles_per_cell,
          FieldInfo{"particles_per_cell", "", "Particles in a grid cell", {.low = 0, .high = 1000, .low_open = true}});
    visit(&E::velocity, FieldInfo{"velocity", "m/s", "Velocity of the new particles; a stream needs one"});
    visit(&E::rate, FieldInfo{"rate", "1/s", "Particles a second; default and upper limit: what fills the space swept",
                              Range::positive()}
                        .only_in("stream"));
    visit(&E::start_time,
          FieldInfo{"start_time", "s", "When the stream starts", Range::not_negative()}.only_in("stream"));
    visit(&E::end_time,
          FieldInfo{"end_time", "s", "When the stream ends", Range::positive()}.mandatory().only_in("stream"));
    visit(
        &E::times,
        FieldInfo{"times", "s", "When the body appears, in ascending order", Range::not_negative()}.mandatory().only_in(
            "burst"));
    visit(&E::particle_limit,
          FieldInfo{"particle_limit", "", "Most particles that it may send out in the run", Range::between(1, 2e9)});
  }
};

}  // namespace graupel
