// Moving least squares for 16 points at once (rom/interpolation/mls_interpolation.h). With d_j = (X_j - X) / h, c and C
// the weighted mean and covariance of the d_j:
//   f(X) = sum_j phi_j f_j,  phi_j = w_j q_j,  q_j = (1 - z^T (d_j - c)) / sum w,  z = C^-1 c.
#pragma once

#include <cstdint>
#include <cstring>
#include <vector>

#include "core/math/vec.h"
#include "mpm/particles/particles.h"

namespace graupel::rom {

/// Numbers of a particle: X, x - X [m], v [m/s].
inline constexpr int64_t trunk_record = 9;

/// The particles that a tile takes from.
template <typename T>
struct MlsTileSource {
  const int32_t *begin, *end;  ///< indices of records and kinds
  const T* records;
  const int32_t* kinds;
};

template <typename T>
class MlsTile {
 public:
  explicit MlsTile(double radius) : per_radius_(static_cast<T>(1 / radius)) {}

  void place(int64_t lane, const Vec3f& x, int32_t kind) {
    for (int a = 0; a < 3; ++a) reference_[a][lane] = static_cast<T>(x[a]);
    kind_[lane] = static_cast<T>(kind);
  }

  /// Finds the weights phi of these particles.
  void fit(const MlsTileSource<T>& source) {
    source_ = source;
    phi_.resize(static_cast<std::size_t>(source.end - source.begin));
    Lanes sum{}, d[3];
    for (int a = 0; a < 3; ++a) center_[a] = Lanes{};
    for (std::size_t j = 0; j < phi_.size(); ++j) {
      const Lanes rest = offset(j, d), w = same_kind(j) * rest * rest;
      phi_[j].lanes = w;
      sum += w;
      for (int a = 0; a < 3; ++a) center_[a] += w * d[a];
    }
    share_ = 1 / sum;
    for (int a = 0; a < 3; ++a) center_[a] *= share_;
    invert_covariance();
    for (std::size_t j = 0; j < phi_.size(); ++j) {
      offset(j, d);
      phi_[j].lanes *= quotient(d);
    }
  }

  /// X + sum_j phi_j (x_j - X_j), [3][16].
  void positions(T* out) const {
    Lanes u[3];
    sum(3, u);
    for (int a = 0; a < 3; ++a) store(reference_[a] + u[a], out + a * mpm::tile);
  }
  void velocities(T* out) const {
    Lanes v[3];
    sum(6, v);
    for (int a = 0; a < 3; ++a) store(v[a], out + a * mpm::tile);
  }

  /// F = I + du/dX, [9][16]. With the residuals r_j = u_j - u(X) - G d_j of the fit,
  ///   du/dX = G / h + sum_j q_j r_j dw_j/dX.
  void gradients(T* out) const {
    Lanes u[3], slope[3][3] = {}, result[3][3] = {}, d[3];
    sum(3, u);
    for (std::size_t j = 0; j < phi_.size(); ++j) {
      const Lanes rest = offset(j, d), w = same_kind(j) * rest * rest * share_;
      const T* u_j = record(j) + 3;
      for (int b = 0; b < 3; ++b) {
        Lanes s{};
        for (int k = 0; k < 3; ++k) s += inverse_[b][k] * (d[k] - center_[k]);
        for (int a = 0; a < 3; ++a) slope[a][b] += w * s * (u_j[a] - u[a]);
      }
    }
    for (std::size_t j = 0; j < phi_.size(); ++j) {
      const Lanes rest = offset(j, d), s = 4 * same_kind(j) * rest * quotient(d);
      const T* u_j = record(j) + 3;
      for (int a = 0; a < 3; ++a) {
        const Lanes r = u_j[a] - u[a] - slope[a][0] * d[0] - slope[a][1] * d[1] - slope[a][2] * d[2];
        for (int b = 0; b < 3; ++b) result[a][b] += s * d[b] * r;
      }
    }
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b)
        store((slope[a][b] + result[a][b]) * per_radius_ + (a == b ? T(1) : T(0)), out + (3 * a + b) * mpm::tile);
  }

 private:
  typedef T Lanes __attribute__((vector_size(mpm::tile * sizeof(T))));
  struct Weight {
    Lanes lanes;  ///< an argument of a template would lose the attribute
  };
  /// Added to C, which has no inverse where neighbours lie in a plane or on a line: no slope across it. [1]
  static constexpr T ridge = sizeof(T) == sizeof(float) ? T(1e-6) : T(1e-12);

  const T* record(std::size_t j) const { return source_.records + source_.begin[j] * trunk_record; }
  /// d_j; returns max(0, 1 - |d_j|^2), of which the weight is the square.
  inline Lanes offset(std::size_t j, Lanes* d) const {
    const T* x = record(j);
    for (int a = 0; a < 3; ++a) d[a] = (x[a] - reference_[a]) * per_radius_;
    const Lanes rest = 1 - (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    return rest > 0 ? rest : Lanes{};
  }
  /// 1 where the particle is of the point's kind, else 0.
  inline Lanes same_kind(std::size_t j) const {
    return kind_ == static_cast<T>(source_.kinds[source_.begin[j]]) ? Lanes{} + 1 : Lanes{};
  }
  /// q_j.
  inline Lanes quotient(const Lanes* d) const {
    return share_ *
           (1 - (slant_[0] * (d[0] - center_[0]) + slant_[1] * (d[1] - center_[1]) + slant_[2] * (d[2] - center_[2])));
  }
  inline void sum(int first, Lanes* total) const {
    for (int a = 0; a < 3; ++a) total[a] = Lanes{};
    for (std::size_t j = 0; j < phi_.size(); ++j) {
      const T* f = record(j) + first;
      for (int a = 0; a < 3; ++a) total[a] += phi_[j].lanes * f[a];
    }
  }
  static void store(const Lanes& lanes, T* out) { std::memcpy(out, &lanes, sizeof lanes); }

  /// C^-1 and z, while phi_ holds the w_j.
  void invert_covariance() {
    Lanes xx{}, xy{}, xz{}, yy{}, yz{}, zz{}, d[3];
    for (std::size_t j = 0; j < phi_.size(); ++j) {
      offset(j, d);
      const Lanes w = phi_[j].lanes * share_, x = d[0] - center_[0], y = d[1] - center_[1], z = d[2] - center_[2];
      xx += w * x * x;
      xy += w * x * y;
      xz += w * x * z;
      yy += w * y * y;
      yz += w * y * z;
      zz += w * z * z;
    }
    xx += ridge;
    yy += ridge;
    zz += ridge;
    const Lanes a = yy * zz - yz * yz, b = xz * yz - xy * zz, c = xy * yz - xz * yy,
                per_determinant = 1 / (xx * a + xy * b + xz * c);
    inverse_[0][0] = a * per_determinant;
    inverse_[0][1] = inverse_[1][0] = b * per_determinant;
    inverse_[0][2] = inverse_[2][0] = c * per_determinant;
    inverse_[1][1] = (xx * zz - xz * xz) * per_determinant;
    inverse_[1][2] = inverse_[2][1] = (xy * xz - xx * yz) * per_determinant;
    inverse_[2][2] = (xx * yy - xy * xy) * per_determinant;
    for (int k = 0; k < 3; ++k)
      slant_[k] = inverse_[k][0] * center_[0] + inverse_[k][1] * center_[1] + inverse_[k][2] * center_[2];
  }

  T per_radius_;
  MlsTileSource<T> source_ = {};
  Lanes reference_[3], kind_;
  Lanes center_[3], share_, slant_[3], inverse_[3][3];
  std::vector<Weight> phi_;
};

}  // namespace graupel::rom
