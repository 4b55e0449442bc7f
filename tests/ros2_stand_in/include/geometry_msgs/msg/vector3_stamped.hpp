#pragma once
#include "geometry_msgs/msg/vector3.hpp"
#include "std_msgs/msg/header.hpp"
namespace geometry_msgs::msg
{
struct Vector3Stamped
{
  std_msgs::msg::Header header;
  Vector3 vector;
};
}  // namespace geometry_msgs::msg
