// The linear algebra that rigs need: small square matrices, row major, in double precision.
#pragma once

#include <array>
#include <cstddef>

namespace endosdk {

using Vec3 = std::array<double, 3>;
using Mat3 = std::array<double, 9>;

// Side of a square matrix with `size` numbers.
constexpr size_t side_of(size_t size) {
  size_t side = 0;
  while (side * side < size) ++side;
  return side;
}

template <size_t size>
std::array<double, size> multiply(const std::array<double, size>& a, const std::array<double, size>& b) {
  constexpr size_t n = side_of(size);
  std::array<double, size> product{};
  for (size_t row = 0; row < n; ++row) {
    for (size_t column = 0; column < n; ++column) {
      for (size_t k = 0; k < n; ++k) product[n * row + column] += a[n * row + k] * b[n * k + column];
    }
  }
  return product;
}

template <size_t size>
std::array<double, side_of(size)> multiply(const std::array<double, size>& a, const std::array<double, side_of(size)>& v) {
  constexpr size_t n = side_of(size);
  std::array<double, n> product{};
  for (size_t row = 0; row < n; ++row) {
    for (size_t k = 0; k < n; ++k) product[row] += a[n * row + k] * v[k];
  }
  return product;
}

// Gaussian elimination: turns the n x n matrix `a` into the unit matrix, and the unit matrix in `b` into the inverse of `a`.
void eliminate(double* a, double* b, size_t n);

// The determinant must not be zero. Callers check it if the matrix comes from a user.
template <size_t size>
std::array<double, size> inverse(std::array<double, size> a) {
  constexpr size_t n = side_of(size);
  std::array<double, size> result{};
  for (size_t i = 0; i < n; ++i) result[i * n + i] = 1.0;
  eliminate(a.data(), result.data(), n);
  return result;
}

Mat3 transpose(const Mat3& a);
double determinant(const Mat3& a);

double dot(const Vec3& a, const Vec3& b);
Vec3 cross(const Vec3& a, const Vec3& b);
double norm(const Vec3& v);
Vec3 scale(const Vec3& v, double factor);

// The rotation nearest to `a` (the orthonormal factor of its polar decomposition).
Mat3 nearest_rotation(const Mat3& a);

// Rotation matrix to axis times angle (radians, below pi) and back.
Vec3 rotation_vector(const Mat3& rotation);
Mat3 rotation_matrix(const Vec3& vector);

}  // namespace endosdk
