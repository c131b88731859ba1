#include "mpm/scene/emission.h"

#include <fmt/format.h>

#include <cmath>

#include "core/math/random.h"
#include "core/parallel/memory.h"
#include "core/system/error.h"
#include "mpm/memory_need.h"
#include "mpm/scene/plane_section.h"

namespace graupel::mpm {

namespace {

std::string name_of(const Emitter& emitter, std::size_t index) {
  return fmt::format("emitter {0} (/emitters/{0}, {1} of '{2}')", index, word_of(emitter.shape), emitter.material);
}

Source source_of(const Emitter& emitter) {
  Source source;
  static_cast<Body&>(source) = emitter;
  source.material = emitter.material;
  source.sampling = Sampling::jittered_lattice;
  source.particles_per_cell = emitter.particles_per_cell;
  return source;
}

/// The box of a body seen along a direction, in the body's own frame.
struct View {
  Vec3d across[2], along;  ///< unit vectors; along the direction
  double low[2], high[2];  ///< extent across [m]
  double front, back;      ///< extent along [m]

  View(const sparsegrid::LocalBox& box, const Vec3d& direction) : along(direction) {
    const Vec3d helper = std::abs(along[0]) < 0.9 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
    const Vec3d first = normalized(cross(along, helper));
    look_across(box, first, cross(along, first));
  }
  /// Takes these for the unit vectors across the direction.
  void look_across(const sparsegrid::LocalBox& box, const Vec3d& first, const Vec3d& second) {
    across[0] = first;
    across[1] = second;
    low[0] = low[1] = back = 1e300;
    high[0] = high[1] = front = -1e300;
    for (int corner = 0; corner < 8; ++corner) {
      Vec3d x;
      for (int d = 0; d < 3; ++d) x[d] = corner >> d & 1 ? box.high[d] : box.low[d];
      for (int a = 0; a < 2; ++a) {
        low[a] = std::min(low[a], dot(x, across[a]));
        high[a] = std::max(high[a], dot(x, across[a]));
      }
      back = std::min(back, dot(x, along));
      front = std::max(front, dot(x, along));
    }
  }
  Vec3d point(double a, double b, double s) const { return a * across[0] + b * across[1] + s * along; }
};

/// Foremost point of the body on the line (a, b), to a hundredth of `spacing`; false where the line misses the body.
bool front_of(const SourceBody& body, const View& view, double a, double b, double spacing, double& s) {
  const double step = spacing / 4;
  const auto steps = static_cast<int64_t>(std::ceil((view.front - view.back) / step));
  for (int64_t i = 0; i <= steps; ++i) {
    s = view.front - (static_cast<double>(i) + 0.5) * step;
    if (!body.contains(view.point(a, b, s))) continue;
    double inside = s, outside = s + step;
    while (outside - inside > 0.01 * spacing) {
      s = 0.5 * (inside + outside);
      (body.contains(view.point(a, b, s)) ? inside : outside) = s;
    }
    s = inside;
    return true;
  }
  return false;
}

void check_limit(const Emitter& emitter, std::size_t index, double count) {
  if (count > static_cast<double>(emitter.particle_limit))
    throw ConfigError(fmt::format(
        "{} would send out too many particles ({:.0f}, particle_limit: {}). Raise particle_limit, lower the rate or "
        "particles_per_cell, or end the emission earlier",
        name_of(emitter, index), count, emitter.particle_limit));
  const double needed = count * set_up_bytes, available = static_cast<double>(available_bytes(Device::cpu));
  if (needed > available)
    throw ConfigError(fmt::format(
        "{} would send out more particles than fit into memory ({:.0f}, which need at least {:.4g} GB, {:.4g} GB "
        "available). Lower the rate or particles_per_cell, or end the emission earlier",
        name_of(emitter, index), count, 1e-9 * needed, 1e-9 * available));
}

/// Lines of the lattice across the stream that meet the body, numbered; each layer has one particle a line. In the
/// plane there is one row of them, which lies in it.
struct Lattice {
  double spacing, low[2];
  int64_t n[2];
  bool flat = false;

  Lattice(const View& view, double spacing_) : spacing(spacing_) {
    for (int a = 0; a < 2; ++a) {
      n[a] = static_cast<int64_t>(std::ceil((view.high[a] - view.low[a]) / spacing - 1e-9));
      low[a] = (view.low[a] + view.high[a] - static_cast<double>(n[a]) * spacing) / 2;
    }
  }
  /// The row at `height` along the second direction across.
  void flatten(double height) {
    flat = true;
    n[1] = 1;
    low[1] = height;
  }
  double at(int axis, int64_t cell, double fraction) const {
    if (flat && axis == 1) return low[1];
    return low[axis] + (static_cast<double>(cell) + fraction) * spacing;
  }
};

/// The lattice of a stream across its body.
struct StreamLattice {
  SourceBody body;
  View view;
  Lattice lattice;
  std::vector<int64_t> lines;  ///< that meet the body

  StreamLattice(const Emitter& emitter, std::size_t index, const Domain& domain)
      : body(source_of(emitter), index, domain.dx / 4),
        view(body.bounds(), transpose(emitter.rotation()) * (emitter.velocity * (1 / norm(emitter.velocity)))),
        lattice(turned(emitter, domain), domain.spacing(emitter.particles_per_cell)) {
    if (domain.is_plane()) lattice.flatten(domain.plane() - emitter.position[2]);
    double s;
    for (int64_t line = 0; line < lattice.n[0] * lattice.n[1]; ++line)
      if (front_of(body, view, lattice.at(0, line / lattice.n[1], 0.5), lattice.at(1, line % lattice.n[1], 0.5),
                   lattice.spacing, s))
        lines.push_back(line);
  }

  /// Particles that fill the space swept [1/s].
  double full_rate(double speed) const { return static_cast<double>(lines.size()) * speed / lattice.spacing; }

 private:
  /// In the plane the second direction across is its normal.
  const View& turned(const Emitter& emitter, const Domain& domain) {
    if (!domain.is_plane()) return view;
    const Vec3d normal = transpose(emitter.rotation()) * Vec3d{0, 0, 1};
    view.look_across(body.bounds(), cross(normal, view.along), normal);
    return view;
  }
};

EmittedParticles stream(const Emitter& emitter, std::size_t index, const Domain& domain, uint64_t seed) {
  const double speed = norm(emitter.velocity);
  if (!(speed > 0))
    throw ConfigError(fmt::format("{} has no velocity (0 m/s, above 0 for a stream). Give it one, or use bursts",
                                  name_of(emitter, index)));
  const StreamLattice across(emitter, index, domain);
  const auto& [body, view, lattice, lines] = across;
  const double spacing = lattice.spacing, full_rate = across.full_rate(speed), rate = emitter.rate.value_or(full_rate);
  if (lines.empty())
    throw ConfigError(
        fmt::format("{} is thinner than its particles' spacing ({:.3g} m). Make it wider or raise "
                    "particles_per_cell",
                    name_of(emitter, index), spacing));
  if (rate > full_rate * (1 + 1e-9))
    throw ConfigError(
        fmt::format("{} has a rate at which new particles would overlap those before ({:.6g} 1/s, at most {:.6g} 1/s "
                    "at this speed). "
                    "Lower it, leave it out, or raise the velocity",
                    name_of(emitter, index), rate, full_rate));
  const double interval = static_cast<double>(lines.size()) / rate;  // between layers [s]
  check_limit(emitter, index, std::max(0.0, emitter.end_time - emitter.start_time) * rate);
  EmittedParticles out;
  const Random random(seed, RandomPurpose::emission, index);
  double s;
  for (uint64_t draw = 0;; ++draw) {
    const uint64_t layer = draw / lines.size();
    const int64_t line = lines[draw % lines.size()];
    if (emitter.start_time + static_cast<double>(layer) * interval >= emitter.end_time) break;
    const double time = emitter.start_time + (static_cast<double>(layer) + random.uniform(draw, 2)) * interval;
    double a = lattice.at(0, line / lattice.n[1], random.uniform(draw, 0)),
           b = lattice.at(1, line % lattice.n[1], random.uniform(draw, 1));
    if (!front_of(body, view, a, b, spacing, s)) {  // moved off the rim: keep the middle of its cell
      a = lattice.at(0, line / lattice.n[1], 0.5), b = lattice.at(1, line % lattice.n[1], 0.5);
      front_of(body, view, a, b, spacing, s);
    }
    if (time >= emitter.end_time) continue;
    out.position.push_back(emitter.to_world(view.point(a, b, s)));
    out.time.push_back(time);
  }
  return out;
}

EmittedParticles bursts(const Emitter& emitter, std::size_t index, const Domain& domain, uint64_t seed) {
  const Source source = source_of(emitter);
  const SourceBody body(source, index, domain.dx / 4);
  const double speed = norm(emitter.velocity);
  const View view(body.bounds(),
                  speed > 0 ? transpose(emitter.rotation()) * (emitter.velocity * (1 / speed)) : Vec3d{0, 1, 0});
  for (std::size_t k = 1; k < emitter.times.size(); ++k) {
    const double moved = (emitter.times[k] - emitter.times[k - 1]) * speed, length = view.front - view.back;
    if (!(moved >= length * (1 - 1e-9)))
      throw ConfigError(fmt::format(
          "{}: the burst at {:.6g} s would overlap the one before (it moves {:.4g} m until then, at least {:.4g} m). "
          "Leave more time between bursts or raise the velocity",
          name_of(emitter, index), emitter.times[k], moved, length));
  }
  const double measure = domain.is_plane() ? PlaneSection(source, body, domain.plane()).area() : body.volume();
  const double expected = measure * emitter.particles_per_cell / domain.cell_volume();
  check_limit(emitter, index, expected * static_cast<double>(emitter.times.size()));
  EmittedParticles out;
  for (std::size_t k = 0; k < emitter.times.size(); ++k) {
    const uint64_t stream_number = index + (static_cast<uint64_t>(k + 1) << 32);
    for (const Vec3d& local :
         sample_body(source, index, domain, Random(seed, RandomPurpose::emission, stream_number))) {
      out.position.push_back(emitter.to_world(local));
      out.time.push_back(emitter.times[k]);
    }
  }
  return out;
}

}  // namespace

EmittedParticles sample_emitter(const Emitter& emitter, std::size_t index, const Domain& domain, uint64_t seed) {
  EmittedParticles particles = emitter.emission == Emission::stream ? stream(emitter, index, domain, seed)
                                                                    : bursts(emitter, index, domain, seed);
  check_limit(emitter, index, static_cast<double>(particles.position.size()));
  return particles;
}

Emitter with_flux_of(const Emitter& emitter, std::size_t index, const Domain& from, const Domain& to, double share) {
  const double volumes = to.cell_volume() / from.cell_volume(), speed = norm(emitter.velocity);
  const auto with_particles = [&](double factor) {  // times as many in a cell
    Emitter other = emitter;
    other.particles_per_cell = emitter.particles_per_cell * factor;
    const double more = std::max(1.0, 1.1 * factor / volumes), limit = static_cast<double>(emitter.particle_limit);
    other.particle_limit = static_cast<int64_t>(std::ceil(more * limit));
    return other;
  };
  if (emitter.emission != Emission::stream || !(speed > 0)) return with_particles(share);
  const double rate = emitter.rate.value_or(StreamLattice(emitter, index, from).full_rate(speed));
  const auto with_flux = [&](double factor) {  // the particles' volume decides on the rate
    Emitter other = with_particles(factor);
    other.rate = rate * factor / volumes;
    return other;
  };
  // A lattice covers a little more or less than the body: the nearest number of particles a cell with room for the
  // flux. That of the scene's own particles has.
  constexpr double step = 1.01;
  const auto steps = static_cast<int>(std::abs(std::log(volumes / share)) / std::log(step));
  for (int i = 0; i <= 2 * steps; ++i) {
    Emitter other = with_flux(share * std::pow(step, (i % 2 == 0 ? 1 : -1) * ((i + 1) / 2)));
    if (StreamLattice(other, index, to).full_rate(speed) >= *other.rate) return other;
  }
  return with_flux(volumes);
}

}  // namespace graupel::mpm
