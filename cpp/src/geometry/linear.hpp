// The little linear algebra that calibration needs: 3x3 matrices, row major, in double precision.
#pragma once

#include <array>

namespace endosdk {

using Vec3 = std::array<double, 3>;
using Mat3 = std::array<double, 9>;

Mat3 multiply(const Mat3& a, const Mat3& b);
Vec3 multiply(const Mat3& a, const Vec3& v);
Mat3 transpose(const Mat3& a);
double determinant(const Mat3& a);

// The determinant must not be zero; callers check it where a user could have caused it.
Mat3 inverse(const Mat3& a);

Vec3 cross(const Vec3& a, const Vec3& b);
double norm(const Vec3& v);
Vec3 scale(const Vec3& v, double factor);

// The rotation nearest to `a` (the orthonormal factor of its polar decomposition).
Mat3 nearest_rotation(const Mat3& a);

// Rotation matrix to axis times angle (radians, below pi) and back.
Vec3 rotation_vector(const Mat3& rotation);
Mat3 rotation_matrix(const Vec3& vector);

}  // namespace endosdk
