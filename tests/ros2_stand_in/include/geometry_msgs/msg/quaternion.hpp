#pragma once
namespace geometry_msgs::msg
{
struct Quaternion
{
  double x = 0.0, y = 0.0, z = 0.0, w = 1.0;
};
}  // namespace geometry_msgs::msg
