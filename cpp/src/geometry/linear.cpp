#include "geometry/linear.hpp"

#include <algorithm>
#include <cmath>

namespace endosdk {

void eliminate(double* a, double* b, size_t n) {
  for (size_t i = 0; i < n; ++i) {
    size_t pivot = i;
    for (size_t row = i + 1; row < n; ++row) {
      if (std::fabs(a[row * n + i]) > std::fabs(a[pivot * n + i])) pivot = row;
    }
    if (pivot != i) {
      std::swap_ranges(a + i * n, a + (i + 1) * n, a + pivot * n);
      std::swap_ranges(b + i * n, b + (i + 1) * n, b + pivot * n);
    }
    const double share = 1.0 / a[i * n + i];
    for (size_t k = 0; k < n; ++k) {
      a[i * n + k] *= share;
      b[i * n + k] *= share;
    }
    for (size_t row = 0; row < n; ++row) {
      if (row == i) continue;
      const double factor = a[row * n + i];
      for (size_t k = 0; k < n; ++k) {
        a[row * n + k] -= factor * a[i * n + k];
        b[row * n + k] -= factor * b[i * n + k];
      }
    }
  }
}

Mat3 transpose(const Mat3& a) { return {a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8]}; }

double determinant(const Mat3& a) {
  const Vec3 c = cross({a[3], a[4], a[5]}, {a[6], a[7], a[8]});
  return a[0] * c[0] + a[1] * c[1] + a[2] * c[2];
}

double dot(const Vec3& a, const Vec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double norm(const Vec3& v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

Vec3 scale(const Vec3& v, double factor) { return {v[0] * factor, v[1] * factor, v[2] * factor}; }

Mat3 nearest_rotation(const Mat3& a) {
  // Newton's iteration for the polar factor: averaging with the inverse transpose drives every singular value to one.
  Mat3 q = a;
  for (int step = 0; step < 20; ++step) {
    const Mat3 other = transpose(inverse(q));
    double change = 0.0;
    for (int i = 0; i < 9; ++i) {
      const double next = 0.5 * (q[i] + other[i]);
      change = std::fmax(change, std::fabs(next - q[i]));
      q[i] = next;
    }
    if (change < 1e-15) break;
  }
  return q;
}

namespace {

// The matrix of a half turn has no antisymmetric part. Its axis a follows from R = 2 a a^T - 1.
Vec3 half_turn(const Mat3& r) {
  constexpr double pi = 3.14159265358979323846;
  int largest = 0;
  for (int i = 1; i < 3; ++i) {
    if (r[4 * i] > r[4 * largest]) largest = i;
  }
  Vec3 axis = {r[3 * largest], r[3 * largest + 1], r[3 * largest + 2]};
  axis[largest] += 1.0;
  return scale(axis, pi / norm(axis));
}

}  // namespace

Vec3 rotation_vector(const Mat3& r) {
  const Vec3 axis = {0.5 * (r[7] - r[5]), 0.5 * (r[2] - r[6]), 0.5 * (r[3] - r[1])};
  const double sine = norm(axis);
  const double cosine = 0.5 * (r[0] + r[4] + r[8] - 1.0);
  if (sine == 0.0 && cosine > 0.0) return {0.0, 0.0, 0.0};
  if (sine == 0.0) return half_turn(r);
  return scale(axis, std::atan2(sine, cosine) / sine);
}

Mat3 rotation_matrix(const Vec3& vector) {
  const double angle = norm(vector);
  if (angle == 0.0) return {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const Vec3 k = scale(vector, 1.0 / angle);
  const double s = std::sin(angle);
  const double c = std::cos(angle);
  const double v = 1.0 - c;
  return {c + v * k[0] * k[0],        v * k[0] * k[1] - s * k[2], v * k[0] * k[2] + s * k[1],
          v * k[0] * k[1] + s * k[2], c + v * k[1] * k[1],        v * k[1] * k[2] - s * k[0],
          v * k[0] * k[2] - s * k[1], v * k[1] * k[2] + s * k[0], c + v * k[2] * k[2]};
}

}  // namespace endosdk
