#pragma once
#include <array>
#include <string>
#include "geometry_msgs/msg/pose_with_covariance_stamped.hpp"
#include "geometry_msgs/msg/vector3.hpp"
namespace geometry_msgs::msg
{
struct Twist
{
  Vector3 linear, angular;
};
struct TwistWithCovariance
{
  Twist twist;
  std::array<double, 36> covariance{};
};
}  // namespace geometry_msgs::msg
namespace nav_msgs::msg
{
struct Odometry
{
  std_msgs::msg::Header header;
  std::string child_frame_id;
  geometry_msgs::msg::PoseWithCovariance pose;
  geometry_msgs::msg::TwistWithCovariance twist;
};
}  // namespace nav_msgs::msg
