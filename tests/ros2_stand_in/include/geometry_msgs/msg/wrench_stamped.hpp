#pragma once
#include "geometry_msgs/msg/vector3.hpp"
#include "std_msgs/msg/header.hpp"
namespace geometry_msgs::msg
{
struct Wrench
{
  Vector3 force, torque;
};
struct WrenchStamped
{
  std_msgs::msg::Header header;
  Wrench wrench;
};
}  // namespace geometry_msgs::msg
