// Drives the generated node through the stand-in.
//   drive loop     replays the recorded closed loop of the pilot in Python as messages, and compares commands with those
//                  of Python and of the pilot in C beside it
//   drive          takes messages from standard input, a line each, and prints what is published:
//                      odometry TIME FRAME CHILD x y z qx qy qz qw vx vy vz wx wy wz variance-of-yaw
//                      bearing TIME FRAME x y z
//                      until TIME      moves the clock on
#include <cmath>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <sstream>

#include "gbt_pilot_node.hpp"
#include "pilot_vectors.h"

namespace
{

constexpr std::int64_t kBegin = 1700000000LL * 1000000000LL;  // as on a real clock

class Watched : public gbt_pilot_ros::PilotNode
{
public:
  using PilotNode::PilotNode;
  gbt_pilot & pilot() {return pilot_;}
};

std::int64_t nanoseconds(double time) {return kBegin + std::llround(1e9 * time);}

builtin_interfaces::msg::Time stamp(double time) {return rclcpp::Time(nanoseconds(time));}

template<typename MessageT>
void on(const std::string & topic, std::function<void(const MessageT &)> callback)
{
  rclcpp::topics<MessageT>()[topic].push_back(callback);
}

template<typename MessageT>
void send(const std::string & topic, const MessageT & message)
{
  rclcpp::Publisher<MessageT>(topic).publish(message);
}

// ---- the recorded loop ----------------------------------------------------------------------------------------------

gbt_pilot beside;  // the pilot in C, called as its header says

void go_on_from(gbt_pilot & pilot, const gbt_real * plan)
{
  std::memcpy(pilot.guidance.room.planner.previous, plan, sizeof pilot.guidance.room.planner.previous);
  std::memcpy(pilot.guidance.follower.top, plan, sizeof pilot.guidance.follower.top);
}

double difference(const gbt_real * one, const gbt_real * other)
{
  double worst = 0.0;
  for (int i = 0; i < GBT_INPUTS; i++) {
    const double off = std::fabs(one[i] - other[i]) / gbt_thrust_max[i];
    if (!(off <= worst)) {worst = off;}
  }
  return worst;
}

nav_msgs::msg::Odometry odometry_of(double time, const gbt_real * pose, const gbt_real * velocity)
{
  nav_msgs::msg::Odometry message;
  message.header.stamp = stamp(time);
  message.header.frame_id = "map";
  message.child_frame_id = "base_link";
  auto & position = message.pose.pose.position;
  auto & linear = message.twist.twist.linear;
  position.x = pose[0];
  position.y = pose[1];
  linear.x = velocity[0];
  linear.y = velocity[1];
#if GBT_DIMENSION == 3
  position.z = pose[2];
  linear.z = velocity[2];
#endif
  message.pose.pose.orientation = gbt_pilot_ros::quaternion_of(pose[GBT_POSE - 1]);
  message.twist.twist.angular.z = velocity[GBT_POSE - 1];
  return message;
}

int replay()
{
  // the first command is due at time 0
  rclcpp::Clock::world_now() = nanoseconds(-gbt_pilot_numbers.period);
  Watched node;
  gbt_pilot_init(&beside);
  const std::string name = std::string("/") + node.get_name();
  gbt_real thrust[GBT_INPUTS] = {};
  int published = 0, tracks = 0, setpoints = 0, healthy = 0, reports = 0;
  geometry_msgs::msg::PoseWithCovarianceStamped track;
  on<geometry_msgs::msg::WrenchStamped>(name + "/command", [&](const auto & message) {
      published++;
      thrust[0] = message.wrench.force.x;
      thrust[1] = message.wrench.force.y;
      if (GBT_DIMENSION == 3) {thrust[2] = message.wrench.force.z;}
      thrust[GBT_INPUTS - 1] = message.wrench.torque.z;
    });
  on<geometry_msgs::msg::PoseWithCovarianceStamped>(name + "/track", [&](const auto & message) {
      track = message;
      tracks++;
    });
  on<nav_msgs::msg::Odometry>(name + "/setpoint", [&](const auto &) {setpoints++;});
  on<diagnostic_msgs::msg::DiagnosticArray>("/diagnostics", [&](const auto & message) {
      reports++;
      healthy += message.status[0].level == diagnostic_msgs::msg::DiagnosticStatus::OK;
    });

  double worst = 0.0, apart = 0.0, yaw = 0.0;
  int commands = 0, compared = 0, faults = 0, bearings = 0;
  for (int k = 0; k < PILOT_CALLS; k++) {
    const auto & call = pilot_calls[k];
    const double time = 1e-9 * static_cast<double>(nanoseconds(call.time) - kBegin);
    if (call.call == NAVIGATED) {
      yaw = call.numbers[GBT_POSE - 1];
      send(name + "/odometry", odometry_of(time, call.numbers, call.numbers + GBT_POSE));
      gbt_pilot_navigate(&beside, time, call.numbers, call.numbers + GBT_POSE, nullptr);
    } else if (call.call == MEASURED) {
      // every third one in the body frame
      const bool body = bearings++ % 3 == 0;
      const double azimuth = call.numbers[0] - (body ? yaw : 0.0);
      geometry_msgs::msg::Vector3Stamped message;
      message.header.stamp = stamp(time);
      message.header.frame_id = body ? "base_link" : "map";
      message.vector.x = 7.0 * std::cos(azimuth);
      message.vector.y = 7.0 * std::sin(azimuth);
      message.vector.z = GBT_DIMENSION == 3 ? 7.0 * std::tan(call.numbers[1]) : 0.0;
      send(name + "/bearing", message);
      gbt_sensor_pose sensor{};
      sensor.frame = GBT_EARTH;
      gbt_pilot_measure(&beside, static_cast<gbt_kind>(call.kind), call.numbers, nullptr, &sensor, time);
    } else {
      gbt_command command;
      rclcpp::advance_to(nanoseconds(call.time));
      gbt_pilot_command(&beside, time, &command);
      commands++;
      if (published != commands) {
        std::printf("%d commands published, %d due\n", published, commands);
        return 1;
      }
      if (call.plan > 0) {
        go_on_from(node.pilot(), pilot_plans[call.plan - 1]);
        go_on_from(beside, pilot_plans[call.plan - 1]);
      }
      if (call.within <= 0.0) {continue;}
      compared++;
      const double off = difference(thrust, call.numbers), from_c = difference(thrust, command.thrust);
      worst = std::fmax(worst, off);
      apart = std::fmax(apart, from_c);
      if (!(off <= call.within) || !(from_c <= call.within)) {
        std::printf("command at %g s: off by %.3g and %.3g, allowed %.3g\n", time, off, from_c, call.within);
        faults++;
      }
    }
  }
  const auto & forecast = beside.forecast;
  for (int i = 0; i < GBT_DIMENSION; i++) {
    const auto & position = track.pose.pose.position;
    const double own[3] = {position.x, position.y, position.z};
    faults += !(std::fabs(own[i] - forecast.mean[0][i]) < 1e-6);
    for (int j = 0; j < GBT_DIMENSION; j++) {
      const double variance = forecast.covariance[0][i][j];
      faults += !(std::fabs(track.pose.covariance[6 * i + j] - variance) <= 1e-6 * (1.0 + std::fabs(variance)));
    }
  }
  std::printf(
    "%d commands, %d compared, %d faults, off %.3g from Python and %.3g from C, %d tracks, %d setpoints, %d of %d "
    "reports without a note, %d warnings\n", commands, compared, faults, worst, apart, tracks, setpoints, healthy, reports,
    rclcpp::warnings());
  return faults > 0;
}

// ---- messages from standard input -----------------------------------------------------------------------------------

void take(const std::string & line, const std::string & name)
{
  std::istringstream words(line);
  std::string kind, frame, child;
  double time = 0.0;
  words >> kind >> time;
  if (kind == "odometry") {
    nav_msgs::msg::Odometry message;
    auto & pose = message.pose.pose;
    auto & twist = message.twist.twist;
    words >> message.header.frame_id >> message.child_frame_id >> pose.position.x >> pose.position.y >> pose.position.z;
    words >> pose.orientation.x >> pose.orientation.y >> pose.orientation.z >> pose.orientation.w;
    words >> twist.linear.x >> twist.linear.y >> twist.linear.z >> twist.angular.x >> twist.angular.y >> twist.angular.z;
    words >> message.pose.covariance[35];
    message.header.stamp = stamp(time);
    send(name + "/odometry", message);
  } else if (kind == "bearing") {
    geometry_msgs::msg::Vector3Stamped message;
    words >> message.header.frame_id >> message.vector.x >> message.vector.y >> message.vector.z;
    message.header.stamp = stamp(time);
    send(name + "/bearing", message);
  } else {
    rclcpp::advance_to(nanoseconds(time));
  }
}

int listen()
{
  rclcpp::Clock::world_now() = nanoseconds(-0.5 * gbt_pilot_numbers.period);
  Watched node(rclcpp::NodeOptions().append_parameter_override("health_period_s", 0.1));
  const std::string name = std::string("/") + node.get_name();
  on<diagnostic_msgs::msg::DiagnosticArray>("/diagnostics", [](const auto & message) {
      const auto & status = message.status[0];
      std::printf("health %d %s", static_cast<int>(status.level), status.message.c_str());
      for (const auto & one : status.values) {std::printf("; %s=%s", one.key.c_str(), one.value.c_str());}
      std::printf("\n");
    });
  on<geometry_msgs::msg::WrenchStamped>(name + "/command", [](const auto & message) {
      const auto & force = message.wrench.force;
      std::printf(
        "command %s %.17g %.17g %.17g %.17g\n", message.header.frame_id.c_str(), force.x, force.y, force.z,
        message.wrench.torque.z);
    });
  std::string line;
  while (std::getline(std::cin, line)) {
    take(line, name);
    // what the pilot made of it
    const gbt_own_track & own = node.pilot().own;
    if (own.count > 0) {
      const gbt_own_state & last = own.state[own.count - 1];
      std::printf("own %.17g", last.time);
      for (int i = 0; i < GBT_POSE; i++) {std::printf(" %.17g", static_cast<double>(last.pose[i]));}
      for (int i = 0; i < GBT_POSE; i++) {std::printf(" %.17g", static_cast<double>(last.rates[i]));}
      std::printf(" %.17g\n", static_cast<double>(last.heading_std));
    }
    const gbt_intake & intake = node.pilot().intake;
    if (intake.arrived > 0) {
      const gbt_sighting & seen = intake.sightings[intake.taken + intake.arrived - 1];
      std::printf("seen %.17g", seen.time);
      for (int i = 0; i < GBT_DIMENSION - 1; i++) {std::printf(" %.17g", static_cast<double>(seen.value[i]));}
      std::printf("\n");
    }
  }
  return 0;
}

}  // namespace

int main(int argc, char ** argv) {return argc > 1 && std::string(argv[1]) == "loop" ? replay() : listen();}
