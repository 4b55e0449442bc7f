#include "gbt_pilot_node.hpp"

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<gbt_pilot_ros::PilotNode>());
  rclcpp::shutdown();
}
