// Attitude of the vehicle out of the quaternion of an odometry.
#pragma once

#include <array>
#include <cmath>

#include "geometry_msgs/msg/quaternion.hpp"

namespace gbt_pilot_ros
{

using Vector = std::array<double, 3>;

constexpr double kHalfTurn = 3.141592653589793;

// Attitude of a vehicle: its yaw, and the rest, which turns the body frame into the level frame of that yaw.
struct Attitude
{
  double yaw = 0.0;
  std::array<Vector, 3> tilt{{{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}};

  Vector level(const Vector & v) const
  {
    Vector out{};
    for (int i = 0; i < 3; i++) {
      for (int j = 0; j < 3; j++) {out[i] += tilt[i][j] * v[j];}
    }
    return out;
  }
};

// Of a quaternion from the body frame to the earth frame; false if it is none.
inline bool attitude_of(const geometry_msgs::msg::Quaternion & q, Attitude & attitude)
{
  const double norm = std::sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
  if (!(std::fabs(norm - 1.0) < 0.01)) {return false;}  // also what is not finite, and the zeros of an empty message
  const double w = q.w / norm, x = q.x / norm, y = q.y / norm, z = q.z / norm;
  const std::array<Vector, 3> turn{{
    {1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
    {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
    {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}}};
  attitude.yaw = std::atan2(turn[1][0], turn[0][0]);
  const double c = std::cos(attitude.yaw), s = std::sin(attitude.yaw);
  for (int j = 0; j < 3; j++) {
    attitude.tilt[0][j] = c * turn[0][j] + s * turn[1][j];
    attitude.tilt[1][j] = c * turn[1][j] - s * turn[0][j];
    attitude.tilt[2][j] = turn[2][j];
  }
  return true;
}

inline geometry_msgs::msg::Quaternion quaternion_of(double yaw)
{
  geometry_msgs::msg::Quaternion q;
  q.w = std::cos(0.5 * yaw);
  q.z = std::sin(0.5 * yaw);
  return q;
}

}  // namespace gbt_pilot_ros
