#include "mpm/cpu/svd_tile.h"

#include <cmath>

namespace graupel::mpm {

namespace {

constexpr int lanes = static_cast<int>(tile);

/// Jacobi rotation of columns p and q of B, applied to V as well, so that they become orthogonal in every lane.
template <typename T>
void rotate(MatrixTile<T>& B, MatrixTile<T>& V, int p, int q) {
  alignas(64) T cosine[lanes], sine[lanes];
#pragma omp simd
  for (int l = 0; l < lanes; ++l) {
    T alpha = 0, beta = 0, gamma = 0;
    for (int r = 0; r < 3; ++r) {
      alpha += B.m[r][p][l] * B.m[r][p][l];
      beta += B.m[r][q][l] * B.m[r][q][l];
      gamma += B.m[r][p][l] * B.m[r][q][l];
    }
    // tan = 2 gamma / (d + sign(d) sqrt(d^2 + 4 gamma^2)): the smaller root, and 0 / tiny where gamma = 0.
    const T d = beta - alpha, twice = 2 * gamma;
    const T root = std::sqrt(d * d + twice * twice) + std::numeric_limits<T>::min();
    const T tangent = twice / (d >= 0 ? d + root : d - root);
    const T c = 1 / std::sqrt(1 + tangent * tangent);
    cosine[l] = c;
    sine[l] = c * tangent;
  }
  for (int r = 0; r < 3; ++r)
#pragma omp simd
    for (int l = 0; l < lanes; ++l) {
      const T bp = B.m[r][p][l], bq = B.m[r][q][l], vp = V.m[r][p][l], vq = V.m[r][q][l];
      B.m[r][p][l] = cosine[l] * bp - sine[l] * bq;
      B.m[r][q][l] = sine[l] * bp + cosine[l] * bq;
      V.m[r][p][l] = cosine[l] * vp - sine[l] * vq;
      V.m[r][q][l] = sine[l] * vp + cosine[l] * vq;
    }
}

template <typename T>
void squared_lengths(const MatrixTile<T>& B, T (&length2)[3][tile]) {
  for (int c = 0; c < 3; ++c)
#pragma omp simd
    for (int l = 0; l < lanes; ++l)
      length2[c][l] = B.m[0][c][l] * B.m[0][c][l] + B.m[1][c][l] * B.m[1][c][l] + B.m[2][c][l] * B.m[2][c][l];
}

/// Exchanges columns p and q where the later is longer, one of them with its sign turned, so that V stays a rotation.
template <typename T>
void sort_columns(MatrixTile<T>& B, MatrixTile<T>& V, T (&length2)[3][tile], int p, int q) {
  alignas(64) T swap[lanes];
#pragma omp simd
  for (int l = 0; l < lanes; ++l) {
    const T a = length2[p][l], b = length2[q][l];
    swap[l] = a < b ? T(1) : T(0);
    length2[p][l] = a < b ? b : a;
    length2[q][l] = a < b ? a : b;
  }
  for (MatrixTile<T>* M : {&B, &V})
    for (int r = 0; r < 3; ++r)
#pragma omp simd
      for (int l = 0; l < lanes; ++l) {
        const T x = M->m[r][p][l], y = M->m[r][q][l];
        M->m[r][p][l] = swap[l] != 0 ? y : x;
        M->m[r][q][l] = swap[l] != 0 ? -x : y;
      }
}

/// U from the first two columns of B and their cross product; the third singular value keeps its sign.
template <typename T>
void finish(const MatrixTile<T>& B, const T (&length2)[3][tile], SvdTile<T>& result) {
#pragma omp simd
  for (int l = 0; l < lanes; ++l) {
    const T s0 = std::sqrt(length2[0][l]), inverse0 = 1 / s0;
    const T ux = B.m[0][0][l] * inverse0, uy = B.m[1][0][l] * inverse0, uz = B.m[2][0][l] * inverse0;
    const T s1 = std::sqrt(length2[1][l]), inverse1 = 1 / s1;
    const T vx = B.m[0][1][l] * inverse1, vy = B.m[1][1][l] * inverse1, vz = B.m[2][1][l] * inverse1;
    const T wx = uy * vz - uz * vy, wy = uz * vx - ux * vz, wz = ux * vy - uy * vx;
    T(&U)[3][3][tile] = result.U.m;
    U[0][0][l] = ux, U[1][0][l] = uy, U[2][0][l] = uz;
    U[0][1][l] = vx, U[1][1][l] = vy, U[2][1][l] = vz;
    U[0][2][l] = wx, U[1][2][l] = wy, U[2][2][l] = wz;
    result.sigma[0][l] = s0;
    result.sigma[1][l] = s1;
    result.sigma[2][l] = wx * B.m[0][2][l] + wy * B.m[1][2][l] + wz * B.m[2][2][l];
  }
}

/// Lanes whose second singular value is lost against the first need the care of the scalar routine.
template <typename T>
void repair_deficient(const MatrixTile<T>& F, const T (&length2)[3][tile], SvdTile<T>& result) {
  for (int l = 0; l < lanes; ++l) {
    if (length2[1][l] > T(1e-10) * length2[0][l]) continue;
    Mat<T, 3> one;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) one(r, c) = F.m[r][c][l];
    const Svd<T, 3> d = svd(one);
    for (int r = 0; r < 3; ++r) {
      result.sigma[r][l] = d.sigma[r];
      for (int c = 0; c < 3; ++c) {
        result.U.m[r][c][l] = d.U(r, c);
        result.V.m[r][c][l] = d.V(r, c);
      }
    }
  }
}

template <typename T>
void decompose(const MatrixTile<T>& F, SvdTile<T>& result) {
  constexpr int sweeps = sizeof(T) == 4 ? 4 : 6;
  MatrixTile<T> B = F;
  MatrixTile<T>& V = result.V;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c)
      for (int l = 0; l < lanes; ++l) V.m[r][c][l] = r == c ? T(1) : T(0);
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    rotate(B, V, 0, 1);
    rotate(B, V, 0, 2);
    rotate(B, V, 1, 2);
  }
  alignas(64) T length2[3][tile];
  squared_lengths(B, length2);
  sort_columns(B, V, length2, 0, 1);
  sort_columns(B, V, length2, 1, 2);
  sort_columns(B, V, length2, 0, 1);
  finish(B, length2, result);
  repair_deficient(F, length2, result);
}

}  // namespace

void svd_tile(const MatrixTile<float>& F, SvdTile<float>& result) { decompose(F, result); }
void svd_tile(const MatrixTile<double>& F, SvdTile<double>& result) { decompose(F, result); }

}  // namespace graupel::mpm
