#pragma once
#include <array>
#include "geometry_msgs/msg/quaternion.hpp"
#include "std_msgs/msg/header.hpp"
namespace geometry_msgs::msg
{
struct Point
{
  double x = 0.0, y = 0.0, z = 0.0;
};
struct Pose
{
  Point position;
  Quaternion orientation;
};
struct PoseWithCovariance
{
  Pose pose;
  std::array<double, 36> covariance{};
};
struct PoseWithCovarianceStamped
{
  std_msgs::msg::Header header;
  PoseWithCovariance pose;
};
}  // namespace geometry_msgs::msg
