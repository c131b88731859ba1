#include "mpm/scene/scene_hash.h"

#include <bit>
#include <cmath>
#include <type_traits>

#include "core/system/atomic_file.h"
#include "core/system/fnv1a.h"

namespace graupel::mpm {

namespace {

template <typename T>
struct IsVector : std::false_type {};
template <typename T>
struct IsVector<std::vector<T>> : std::true_type {};

template <typename T>
struct IsOptional : std::false_type {};
template <typename T>
struct IsOptional<std::optional<T>> : std::true_type {};

/// The nearest number with 30 bits after the first: adding half of what is cut carries into the exponent where it must.
/// What may be left of a difference is 0.
double rounded_number(double x) {
  if (std::abs(x) < 1e-12) return 0;
  constexpr int cut = 52 - 30;
  const uint64_t bits = std::bit_cast<uint64_t>(x) + (uint64_t(1) << (cut - 1));
  return std::bit_cast<double>(bits >> cut << cut);
}

/// Walks the declared fields of a config struct (core/scene/fields.h).
class FieldHash {
 public:
  FieldHash(uint64_t start, bool rounded) : hash_(start), rounded_(rounded) {}
  uint64_t value() const { return hash_; }

  template <typename V>
  void add(const V& value) {
    if constexpr (std::is_same_v<V, std::string>) {
      add(value.size());
      add_bytes(value.data(), value.size());
    } else if constexpr (IsVector<V>::value) {
      add(value.size());
      for (const auto& item : value) add(item);
    } else if constexpr (std::is_same_v<V, std::map<std::string, MaterialConfig>>) {
      for (const auto& [key, item] : value) {
        add(key);
        add_struct(item);
      }
    } else if constexpr (IsOptional<V>::value) {
      add(value.has_value());
      if (value) add(*value);
    } else if constexpr (std::is_same_v<V, double>) {
      const double used = rounded_ ? rounded_number(value) : value;
      add_bytes(&used, sizeof(used));
    } else if constexpr (std::is_arithmetic_v<V> || std::is_enum_v<V>) {
      add_bytes(&value, sizeof(value));
    } else if constexpr (std::is_same_v<V, Vec3d>) {
      for (int d = 0; d < 3; ++d) add(value[d]);
    } else if constexpr (std::is_base_of_v<Body, V>) {
      add_struct(value);
      add_geometry(value);
      if constexpr (std::is_same_v<V, Source>)
        if (value.state) add_state(*value.state);
    } else if constexpr (std::is_same_v<V, Mat3d>) {
      for (int i = 0; i < 9; ++i) add(value(i / 3, i % 3));
    } else {
      add_struct(value);
    }
  }

  template <typename S>
  void add_struct(const S& config) {
    S::fields([&](auto member, const FieldInfo& info) {
      const bool irrelevant = info.name == "name" || info.name == "description" || info.name == "frames" ||
                              info.name == "file" || info.name == "preset";
      if (!irrelevant && !is_unused_addition(config.*member)) add(config.*member);
    });
  }

 private:
  /// Keys that scenes did not have when hashes were first stored (scenes/floors) count where they say something.
  template <typename V>
  static bool is_unused_addition(const V& value) {
    if constexpr (std::is_same_v<V, std::vector<TimedLoad>> || std::is_same_v<V, std::vector<GravityKey>>)
      return value.empty();
    return false;
  }

  void add_bytes(const void* bytes, std::size_t n) { hash_ = fnv1a(hash_, bytes, n); }

  void add_geometry(const Body& body) {
    if (body.mesh) {
      for (const Vec3d& v : body.mesh->vertices) add(v);
      for (const auto& t : body.mesh->triangles) add_bytes(t.data(), sizeof(t));
    }
    if (body.points)
      for (const Vec3d& p : *body.points) add(p);
    if (body.shape == Shape::vdb) add(read_file(body.file));  // wherever it lies
  }

  void add_state(const ParticleState& state) {
    add(state.position);
    add(state.velocity);
    add(state.deformation_gradient);
    add(state.affine_velocity);
    add(state.plastic);
    add(state.volume);
    add(state.material);
  }

  uint64_t hash_;
  bool rounded_;
};

uint64_t hash_of(const Scene& scene, uint64_t seed, bool rounded) {
  FieldHash hash(fnv_start, rounded);
  hash.add_struct(scene);
  hash.add(seed);
  return hash.value();
}

}  // namespace

uint64_t scene_hash(const Scene& scene, uint64_t seed) { return hash_of(scene, seed, false); }

uint64_t rounded_scene_hash(const Scene& scene, uint64_t seed) { return hash_of(scene, seed, true); }

}  // namespace graupel::mpm
