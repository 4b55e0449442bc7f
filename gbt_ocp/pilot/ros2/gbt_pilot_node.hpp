// A ROS 2 node around the generated pilot: bearing and odometry in; command, setpoint, track and health out.
//
// Frames are those of REP-103. The earth frame is ENU: x east, y north, z up. The body frame: x ahead, y to port, z up.
// Lengths are in m, angles in rad, velocities in m/s and rad/s, forces in N, moments in N m. Yaw is counter-clockwise
// from east. Stamps are of one clock, the node's own (use_sim_time changes all of them).
//
// Each topic is the parameter `prefix` ("~/") and a parameter of its own:
//   in   odometry_topic ("odometry"), nav_msgs/Odometry: pose in the earth frame, twist over ground in the body frame
//        bearing_topic ("bearing"), geometry_msgs/Vector3Stamped: direction to the target, of any length, in the earth
//        frame or in the body frame (header.frame_id); in the plane z does not count
//   out  command_topic ("command"), geometry_msgs/WrenchStamped: thrust until the next command; body frame, taken as level
//        setpoint_topic ("setpoint"), nav_msgs/Odometry: where the plan is at header.stamp, and how it moves there
//        track_topic ("track"), geometry_msgs/PoseWithCovarianceStamped: the target at header.stamp, earth frame
//        diagnostics_topic ("/diagnostics", without the prefix), diagnostic_msgs/DiagnosticArray: health
// Further parameters: earth_frame ("map"), body_frame ("base_link"); command_period_s (that of the pilot),
// health_period_s (1.0); bearing_sensor (0, number of a sensor of the configuration), bearing_std_rad (0.0: as configured).
//
// In the plane the z of odometry is handed on to setpoint and track, and the z of the track has no covariance.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>

#include "diagnostic_msgs/msg/diagnostic_array.hpp"
#include "diagnostic_msgs/msg/diagnostic_status.hpp"
#include "diagnostic_msgs/msg/key_value.hpp"
#include "geometry_msgs/msg/pose_with_covariance_stamped.hpp"
#include "geometry_msgs/msg/vector3_stamped.hpp"
#include "geometry_msgs/msg/wrench_stamped.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "rclcpp/rclcpp.hpp"

#include "gbt_attitude.hpp"
#include "gbt_pilot.h"

static_assert(GBT_INPUTS == GBT_POSE, "the inputs are a force along each axis and a moment about z");

namespace gbt_pilot_ros
{

using geometry_msgs::msg::PoseWithCovarianceStamped;
using geometry_msgs::msg::Vector3Stamped;
using geometry_msgs::msg::WrenchStamped;
using nav_msgs::msg::Odometry;

constexpr int kSpace = GBT_DIMENSION == 3;
constexpr int kYaw = GBT_POSE - 1;
constexpr int kWarnEveryMs = 5000;

class PilotNode : public rclcpp::Node
{
public:
  explicit PilotNode(const rclcpp::NodeOptions & options = rclcpp::NodeOptions())
  : rclcpp::Node("gbt_pilot", options),
    earth_frame_(declare_parameter<std::string>("earth_frame", "map")),
    body_frame_(declare_parameter<std::string>("body_frame", "base_link")),
    bearing_std_(declare_parameter<double>("bearing_std_rad", 0.0)),
    bearing_sensor_(static_cast<int>(declare_parameter<std::int64_t>("bearing_sensor", 0)))
  {
    const double period = declare_parameter<double>("command_period_s", gbt_pilot_numbers.period);
    const double health_period = declare_parameter<double>("health_period_s", 1.0);
    refuse_unless(period > 0.0 && std::isfinite(period), "command_period_s", "a number above 0");
    refuse_unless(health_period > 0.0 && std::isfinite(health_period), "health_period_s", "a number above 0");
    refuse_unless(bearing_std_ >= 0.0 && std::isfinite(bearing_std_), "bearing_std_rad", "a number from 0 on");
    refuse_unless(
      bearing_sensor_ >= 0 && bearing_sensor_ < GBT_SENSORS, "bearing_sensor",
      "0 to " + std::to_string(GBT_SENSORS - 1));
    refuse_unless(earth_frame_ != body_frame_, "body_frame", "another one than earth_frame");

    gbt_pilot_init(&pilot_);
    const std::string prefix = declare_parameter<std::string>("prefix", "~/");
    const auto topic = [&](const std::string & name) {
        return prefix + declare_parameter<std::string>(name + "_topic", name);
      };
    odometry_ = create_subscription<Odometry>(
      topic("odometry"), rclcpp::SensorDataQoS(), [this](const Odometry & message) {take_odometry(message);});
    bearing_ = create_subscription<Vector3Stamped>(
      topic("bearing"), rclcpp::SensorDataQoS(), [this](const Vector3Stamped & message) {take_bearing(message);});
    command_ = create_publisher<WrenchStamped>(topic("command"), rclcpp::QoS(10));
    setpoint_ = create_publisher<Odometry>(topic("setpoint"), rclcpp::QoS(10));
    track_ = create_publisher<PoseWithCovarianceStamped>(topic("track"), rclcpp::QoS(10));
    diagnostics_ = create_publisher<diagnostic_msgs::msg::DiagnosticArray>(
      declare_parameter<std::string>("diagnostics_topic", "/diagnostics"), rclcpp::QoS(10));
    // timers of the node's own clock, all callbacks in its one group: never two at a time
    command_timer_ = rclcpp::create_timer(
      this, get_clock(), rclcpp::Duration::from_seconds(period), [this]() {command();});
    health_timer_ = rclcpp::create_timer(
      this, get_clock(), rclcpp::Duration::from_seconds(health_period), [this]() {report();});
  }

protected:
  gbt_pilot pilot_;
  gbt_command last_{};

private:
  static void refuse_unless(bool right, const std::string & name, const std::string & allowed)
  {
    if (!right) {throw std::invalid_argument("parameter " + name + ": allowed: " + allowed);}
  }

  // Seconds since the first stamp: a double knows times of 1970 on to less than a microsecond only.
  double seconds(const rclcpp::Time & stamp)
  {
    if (!begun_) {
      begin_ = stamp.nanoseconds();
      begun_ = true;
    }
    return 1e-9 * static_cast<double>(stamp.nanoseconds() - begin_);
  }

  rclcpp::Time stamp_of(double time)
  {
    return rclcpp::Time(begin_ + static_cast<std::int64_t>(std::llround(1e9 * time)), get_clock()->get_clock_type());
  }

  void count(gbt_received answer, const char * what)
  {
    if (answer != GBT_TAKEN && answer != GBT_LATE && answer != GBT_WAITING) {
      RCLCPP_WARN_THROTTLE(
        get_logger(), *get_clock(), kWarnEveryMs, "%s was not taken: answer %d of gbt_received", what, answer);
    }
  }

  void refuse(const char * what, const std::string & found, const std::string & allowed)
  {
    refused_++;
    RCLCPP_WARN_THROTTLE(
      get_logger(), *get_clock(), kWarnEveryMs, "%s: found %s; allowed: %s", what, found.c_str(), allowed.c_str());
  }

  void take_odometry(const Odometry & message)
  {
    Attitude attitude;
    if (message.header.frame_id != earth_frame_ || message.child_frame_id != body_frame_) {
      refuse(
        "odometry", "frames '" + message.header.frame_id + "' and '" + message.child_frame_id + "'",
        "'" + earth_frame_ + "' and '" + body_frame_ + "'");
      return;
    }
    if (!attitude_of(message.pose.pose.orientation, attitude)) {
      refuse("odometry", "an orientation that is no unit quaternion", "one from the body frame to the earth frame");
      return;
    }
    // the pilot's yaw goes on through a full turn
    attitude.yaw = attitude_.yaw + std::remainder(attitude.yaw - attitude_.yaw, 2.0 * kHalfTurn);
    attitude_ = attitude;
    const auto & position = message.pose.pose.position;
    const auto & twist = message.twist.twist;
    const Vector along = attitude_.level({twist.linear.x, twist.linear.y, twist.linear.z});
    const Vector about = attitude_.level({twist.angular.x, twist.angular.y, twist.angular.z});
    const Vector place{position.x, position.y, position.z};
    gbt_real pose[GBT_POSE], velocity[GBT_POSE], covariance[GBT_POSE * GBT_POSE];
    for (int i = 0; i < GBT_DIMENSION; i++) {
      pose[i] = static_cast<gbt_real>(place[i]);
      velocity[i] = static_cast<gbt_real>(along[i]);
    }
    pose[kYaw] = static_cast<gbt_real>(attitude_.yaw);
    velocity[kYaw] = static_cast<gbt_real>(about[2]);
    for (int i = 0; i < GBT_POSE; i++) {
      for (int j = 0; j < GBT_POSE; j++) {
        covariance[i * GBT_POSE + j] = static_cast<gbt_real>(message.pose.covariance[6 * of_six(i) + of_six(j)]);
      }
    }
    // a variance below zero is the way of some drivers to say that they know none
    const bool known = covariance[GBT_POSE * GBT_POSE - 1] >= 0;
    height_ = position.z;
    count(
      gbt_pilot_navigate(&pilot_, seconds(message.header.stamp), pose, velocity, known ? covariance : nullptr),
      "odometry");
  }

  // The place of a number of the pose among x, y, z and the angles about them.
  static int of_six(int i) {return i == kYaw ? 5 : i;}

  void take_bearing(const Vector3Stamped & message)
  {
    Vector line{message.vector.x, message.vector.y, message.vector.z};
    gbt_sensor_pose sensor{};
    sensor.sensor = bearing_sensor_;
    if (message.header.frame_id == earth_frame_) {
      sensor.frame = GBT_EARTH;
    } else if (message.header.frame_id == body_frame_) {
      // from the bow, whatever zero direction the sensor is configured with; level by the last odometry
      line = attitude_.level(line);
      sensor.frame = GBT_BOW;
      sensor.mounted = 1;
#if GBT_LISTED > 0
      const gbt_real * place = gbt_listed_sensors[bearing_sensor_ < GBT_LISTED ? bearing_sensor_ : 0].pose.position;
      for (int i = 0; i < GBT_DIMENSION && bearing_sensor_ < GBT_LISTED; i++) {sensor.position[i] = place[i];}
#endif
    } else {
      refuse("bearing", "frame '" + message.header.frame_id + "'", "'" + earth_frame_ + "' or '" + body_frame_ + "'");
      return;
    }
    const double level = std::hypot(line[0], line[1]);
    if (!(level > 0.0) || !std::isfinite(level) || !std::isfinite(line[2])) {
      refuse("bearing", "a vector without an azimuth", "one that is finite and not along z");
      return;
    }
    const gbt_real angles[2] = {
      static_cast<gbt_real>(std::atan2(line[1], line[0])), static_cast<gbt_real>(std::atan2(line[2], level))};
    const gbt_real std = static_cast<gbt_real>(bearing_std_), deviations[2] = {std, std};
    count(
      gbt_pilot_measure(
        &pilot_, kSpace ? GBT_AZIMUTH_ELEVATION : GBT_AZIMUTH, angles, bearing_std_ > 0.0 ? deviations : nullptr,
        &sensor, seconds(message.header.stamp)),
      "bearing");
  }

  void command()
  {
    const rclcpp::Time now = this->now();
    gbt_pilot_command(&pilot_, seconds(now), &last_);
    WrenchStamped wrench;
    wrench.header.stamp = now;
    wrench.header.frame_id = body_frame_;
    wrench.wrench.force.x = last_.thrust[0];
    wrench.wrench.force.y = last_.thrust[1];
    wrench.wrench.force.z = kSpace ? last_.thrust[kYaw - 1] : 0.0;
    wrench.wrench.torque.z = last_.thrust[kYaw];
    command_->publish(wrench);
    if (last_.status != GBT_COMMANDED && last_.status != GBT_COMMAND_AGAIN) {return;}
    publish_track();
    if (last_.following && last_.setpoint.status == GBT_FOLLOWED) {publish_setpoint();}
  }

  void publish_track()
  {
    if (last_.notes & GBT_NOTE_NO_BEARING) {return;}
    const gbt_forecast & forecast = pilot_.forecast;
    PoseWithCovarianceStamped track;
    track.header.stamp = stamp_of(pilot_.decided_at);
    track.header.frame_id = earth_frame_;
    track.pose.pose.position.x = forecast.mean[0][0];
    track.pose.pose.position.y = forecast.mean[0][1];
    track.pose.pose.position.z = kSpace ? forecast.mean[0][GBT_DIMENSION - 1] : height_;
    track.pose.pose.orientation = quaternion_of(0.0);
    for (int i = 0; i < GBT_DIMENSION; i++) {
      for (int j = 0; j < GBT_DIMENSION; j++) {
        track.pose.covariance[6 * i + j] = forecast.covariance[0][i][j];
      }
    }
    // the attitude of the target is not estimated: any angle is as likely as any other
    for (int i = 3; i < 6; i++) {track.pose.covariance[7 * i] = kHalfTurn * kHalfTurn / 3.0;}
    track_->publish(track);
  }

  void publish_setpoint()
  {
    const gbt_setpoint & at = last_.setpoint;
    Odometry setpoint;
    setpoint.header.stamp = stamp_of(last_.time + gbt_pilot_numbers.lead);
    setpoint.header.frame_id = earth_frame_;
    setpoint.child_frame_id = body_frame_;
    setpoint.pose.pose.position.x = at.z[0];
    setpoint.pose.pose.position.y = at.z[1];
    setpoint.pose.pose.position.z = kSpace ? at.z[GBT_DIMENSION - 1] : height_;
    setpoint.pose.pose.orientation = quaternion_of(at.z[kYaw]);
    const double c = std::cos(static_cast<double>(at.z[kYaw])), s = std::sin(static_cast<double>(at.z[kYaw]));
    setpoint.twist.twist.linear.x = c * at.dz[0] + s * at.dz[1];
    setpoint.twist.twist.linear.y = c * at.dz[1] - s * at.dz[0];
    setpoint.twist.twist.linear.z = kSpace ? at.dz[GBT_DIMENSION - 1] : 0.0;
    setpoint.twist.twist.angular.z = at.dz[kYaw];
    setpoint_->publish(setpoint);
  }

  void report()
  {
    using diagnostic_msgs::msg::DiagnosticStatus;
    static const std::array<const char *, 8> names{
      "no navigation", "navigation old", "time stepped back", "no bearing", "track lost", "forecast held", "fallback",
      "given up"};
    const int grave = GBT_NOTE_NO_NAVIGATION | GBT_NOTE_NAVIGATION_OLD | GBT_NOTE_TRACK_LOST;
    const bool commanded = last_.status == GBT_COMMANDED || last_.status == GBT_COMMAND_AGAIN;
    const int notes = pilot_.commanded ? last_.notes : last_.notes | GBT_NOTE_NO_NAVIGATION;
    const bool failed = (notes & grave) != 0 || !commanded;
    DiagnosticStatus status;
    status.name = std::string(get_name()) + ": pilot";
    status.hardware_id = body_frame_;
    status.level = failed ? DiagnosticStatus::ERROR : notes != 0 ? DiagnosticStatus::WARN : DiagnosticStatus::OK;
    for (std::size_t bit = 0; bit < names.size(); bit++) {
      if ((notes >> bit) & 1) {status.message += (status.message.empty() ? "" : ", ") + std::string(names[bit]);}
    }
    if (status.message.empty()) {status.message = "ok";}
    const auto add = [&status](const std::string & key, const std::string & value) {
        diagnostic_msgs::msg::KeyValue one;
        one.key = key;
        one.value = value;
        status.values.push_back(one);
      };
    add("command_status", std::to_string(static_cast<int>(last_.status)));
    add("planner_status", std::to_string(static_cast<int>(last_.planner)));
    add("plan_origin", std::to_string(static_cast<int>(last_.origin)));
    add("following_a_plan", last_.following ? "true" : "false");
    add("range_known", last_.range_known ? "true" : "false");
    add("bearing_age_s", std::to_string(last_.bearing_age));
    add("navigation_age_s", std::to_string(last_.navigation_age));
    add("measurements_waiting", std::to_string(last_.waiting));
    add("new_tracks", std::to_string(last_.new_tracks));
    for (int k = 1; k < GBT_ANSWERS; k++) {
      add("inputs_answered_" + std::to_string(k), std::to_string(last_.received[k]));
    }
    add("messages_refused", std::to_string(refused_));
    diagnostic_msgs::msg::DiagnosticArray array;
    array.header.stamp = this->now();
    array.status.push_back(status);
    diagnostics_->publish(array);
  }

  std::string earth_frame_, body_frame_;
  double bearing_std_;
  int bearing_sensor_;
  bool begun_ = false;
  std::int64_t begin_ = 0;
  double height_ = 0.0;
  Attitude attitude_;
  unsigned refused_ = 0;
  rclcpp::Subscription<Odometry>::SharedPtr odometry_;
  rclcpp::Subscription<Vector3Stamped>::SharedPtr bearing_;
  rclcpp::Publisher<WrenchStamped>::SharedPtr command_;
  rclcpp::Publisher<Odometry>::SharedPtr setpoint_;
  rclcpp::Publisher<PoseWithCovarianceStamped>::SharedPtr track_;
  rclcpp::Publisher<diagnostic_msgs::msg::DiagnosticArray>::SharedPtr diagnostics_;
  rclcpp::TimerBase::SharedPtr command_timer_, health_timer_;
};

}  // namespace gbt_pilot_ros
