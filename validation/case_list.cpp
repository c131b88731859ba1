#include "validation/case_list.h"

namespace graupel::validation {

const std::vector<Case>& cases() {
  static const std::vector<Case> all = {
      {"free_fall", "A cube in free fall", "x_n = x_0 + n v_0 dt - g dt^2 n (n + 1) / 2", free_fall},
      {"conservation", "One substep of a random state", "Jiang et al. 2015", conservation},
      {"affine_field", "One substep of v = A x + b", "Jiang et al. 2015", affine_field},
      {"kernel_moments", "Weights of the B-splines", "partition of unity, D = dx^2/4 I, dx^2/3 I", kernel_moments},
      {"material_laws", "Stress and return maps of all presets", "objectivity, energy, idempotence", material_laws},
      {"rotating_square", "A rotating elastic square in flight", "rigid motion (matter, EnergyTest)", rotating_square},
      {"colliding_disks", "Two elastic disks collide", "Sulsky, Chen and Schreyer 1994", colliding_disks},
      {"elastic_bar", "First mode of an elastic bar", "omega = (pi / 2 L) sqrt(E / rho)", elastic_bar},
      {"cantilever", "A cantilever under its own weight", "Euler-Bernoulli beam", cantilever},
      {"self_weight_column", "A column under its own weight", "sigma_yy = -rho g (H - y)", self_weight_column},
      {"uniaxial_compression", "A cube between smooth plates", "sigma = E u / l", uniaxial_compression},
      {"bulk_compression", "Soil squeezed in a box", "p = -K ln J", bulk_compression},
      {"hole_in_plate", "A plate with a hole in tension", "Heywood 1952, 3.14", hole_in_plate},
      {"sliding_block", "A block on an inclined plane", "x = g t^2/2 (sin th - mu cos th)", sliding_block},
      {"moving_plane", "A block on a plane that moves", "v = mu g t up to the plane's", moving_plane},
      {"turntable", "A block on a turning table", "rigid rotation", turntable},
      {"curved_track", "A block on a smooth curved track", "v = sqrt(2 g h)", curved_track},
      {"dam_break", "A column of water collapses", "Martin and Moyce 1952", dam_break},
      {"shear_wave", "Decay of a shear wave in water", "exp(-nu k^2 t)", shear_wave},
      {"poiseuille_film", "A Newtonian film on an incline", "u = (rho g_x / mu)(H y - y^2/2)", poiseuille_film},
      {"bingham_film", "A Bingham film on an incline", "plug of thickness tau_0 / (rho g_x)", bingham_film},
      {"infinite_slope", "A layer of sand on an incline", "tan = 2 sqrt(3) sin(phi) / (3 - sin(phi))", infinite_slope},
      {"angle_of_repose", "A poured heap of sand", "the cone's angle in simple shear", angle_of_repose},
      {"column_collapse", "Columns of sand collapse", "Lube et al. 2005, Balmforth and Kerswell 2005", column_collapse},
      {"von_mises_bar", "A metal bar pulled beyond its yield stress", "sigma_Y, slope E K / (E + K)", von_mises_bar},
      {"von_mises_shear", "Metal sheared beyond its yield stress", "sigma_Y / sqrt(3)", von_mises_shear},
      {"snow_range", "Elastic range and hardening of snow", "Stomakhin et al. 2013; Taichi Elements", snow_range},
  };
  return all;
}

}  // namespace graupel::validation
