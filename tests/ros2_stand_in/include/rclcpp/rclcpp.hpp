// A thin stand-in of the part of rclcpp that the generated node uses, with the signatures of ROS 2 Humble and Jazzy:
// topics within one process, and a clock that stands until it is moved.
#pragma once

#include <algorithm>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include "builtin_interfaces/msg/time.hpp"

typedef enum rcl_clock_type_e {
  RCL_CLOCK_UNINITIALIZED = 0, RCL_ROS_TIME, RCL_SYSTEM_TIME, RCL_STEADY_TIME
} rcl_clock_type_t;

namespace rclcpp
{

class Duration
{
public:
  static Duration from_seconds(double seconds)
  {
    Duration one;
    one.nanoseconds_ = static_cast<std::int64_t>(seconds * 1e9 + 0.5);
    return one;
  }
  std::int64_t nanoseconds() const {return nanoseconds_;}

private:
  std::int64_t nanoseconds_ = 0;
};

class Time
{
public:
  explicit Time(std::int64_t nanoseconds = 0, rcl_clock_type_t = RCL_SYSTEM_TIME)
  : nanoseconds_(nanoseconds)
  {
    if (nanoseconds < 0) {throw std::runtime_error("cannot store a negative time point in rclcpp::Time");}
  }
  Time(const builtin_interfaces::msg::Time & time, rcl_clock_type_t = RCL_ROS_TIME)  // NOLINT
  : nanoseconds_(std::int64_t{1000000000} * time.sec + time.nanosec)
  {
    if (nanoseconds_ < 0) {throw std::runtime_error("cannot store a negative time point in rclcpp::Time");}
  }
  operator builtin_interfaces::msg::Time() const
  {
    builtin_interfaces::msg::Time time;
    time.sec = static_cast<std::int32_t>(nanoseconds_ / 1000000000);
    time.nanosec = static_cast<std::uint32_t>(nanoseconds_ % 1000000000);
    return time;
  }
  std::int64_t nanoseconds() const {return nanoseconds_;}

private:
  std::int64_t nanoseconds_;
};

class Clock
{
public:
  using SharedPtr = std::shared_ptr<Clock>;
  Time now() const {return Time(world_now(), RCL_ROS_TIME);}
  rcl_clock_type_t get_clock_type() const noexcept {return RCL_ROS_TIME;}
  static std::int64_t & world_now()
  {
    static std::int64_t now = 0;
    return now;
  }
};

class Logger {};

inline int & warnings()
{
  static int count = 0;
  return count;
}

__attribute__((format(printf, 1, 2))) inline void stand_in_warn(const char * format, ...)
{
  va_list arguments;
  va_start(arguments, format);
  std::vfprintf(stderr, format, arguments);
  va_end(arguments);
  std::fputc('\n', stderr);
  warnings()++;
}

#define RCLCPP_WARN_THROTTLE(logger, clock, duration, ...) \
  do { \
    const rclcpp::Logger & stand_in_logger = (logger); \
    rclcpp::Clock & stand_in_clock = (clock); \
    (void)stand_in_logger, (void)stand_in_clock, (void)(duration); \
    rclcpp::stand_in_warn(__VA_ARGS__); \
  } while (0)

class QoS
{
public:
  QoS(std::size_t depth) {(void)depth;}  // NOLINT
};

class SensorDataQoS : public QoS
{
public:
  SensorDataQoS() : QoS(5) {}
};

// Topics of this process: what is published goes to those that subscribed to the name, in a type of theirs.
template<typename MessageT>
std::map<std::string, std::vector<std::function<void(const MessageT &)>>> & topics()
{
  static std::map<std::string, std::vector<std::function<void(const MessageT &)>>> all;
  return all;
}

template<typename MessageT>
class Publisher
{
public:
  using SharedPtr = std::shared_ptr<Publisher>;
  explicit Publisher(const std::string & topic) : topic_(topic) {}
  void publish(const MessageT & message)
  {
    for (const auto & callback : topics<MessageT>()[topic_]) {callback(message);}
  }

private:
  std::string topic_;
};

template<typename MessageT>
class Subscription
{
public:
  using SharedPtr = std::shared_ptr<Subscription>;
};

class TimerBase
{
public:
  using SharedPtr = std::shared_ptr<TimerBase>;
  std::int64_t period, next;
  std::function<void()> callback;
};

inline std::vector<TimerBase::SharedPtr> & timers()
{
  static std::vector<TimerBase::SharedPtr> all;
  return all;
}

// Moves the clock on, and calls the timers that are due on the way.
inline void advance_to(std::int64_t nanoseconds)
{
  for (;;) {
    TimerBase::SharedPtr first;
    for (const auto & timer : timers()) {
      if (timer->next <= nanoseconds && (!first || timer->next < first->next)) {first = timer;}
    }
    if (!first) {break;}
    Clock::world_now() = std::max(Clock::world_now(), first->next);
    first->next += first->period;
    first->callback();
  }
  Clock::world_now() = std::max(Clock::world_now(), nanoseconds);
}

using ParameterValue = std::variant<bool, std::int64_t, double, std::string>;

class NodeOptions
{
public:
  template<typename ParameterT>
  NodeOptions & append_parameter_override(const std::string & name, const ParameterT & value)
  {
    overrides[name] = value;
    return *this;
  }
  std::map<std::string, ParameterValue> overrides;
};

class Node
{
public:
  explicit Node(const std::string & name, const NodeOptions & options = NodeOptions())
  : name_(name), overrides_(options.overrides), clock_(std::make_shared<Clock>()) {}
  virtual ~Node() = default;
  const char * get_name() const {return name_.c_str();}
  Logger get_logger() const {return Logger();}
  Clock::SharedPtr get_clock() {return clock_;}
  Time now() const {return clock_->now();}

  template<typename ParameterT>
  ParameterT declare_parameter(const std::string & name, const ParameterT & default_value)
  {
    const auto found = overrides_.find(name);
    if (!declared_.emplace(name, true).second) {throw std::runtime_error("parameter '" + name + "' is declared already");}
    // another type than that of the default is refused, as by rclcpp
    return found == overrides_.end() ? default_value : std::get<ParameterT>(found->second);
  }

  template<typename MessageT>
  std::shared_ptr<Publisher<MessageT>> create_publisher(const std::string & topic, const QoS &)
  {
    return std::make_shared<Publisher<MessageT>>(full(topic));
  }

  template<typename MessageT, typename CallbackT>
  std::shared_ptr<Subscription<MessageT>> create_subscription(
    const std::string & topic, const QoS &, CallbackT && callback)
  {
    topics<MessageT>()[full(topic)].push_back(callback);
    return std::make_shared<Subscription<MessageT>>();
  }

private:
  std::string full(const std::string & topic) const
  {
    if (topic.rfind("~/", 0) == 0) {return "/" + name_ + topic.substr(1);}
    return topic.front() == '/' ? topic : "/" + topic;
  }

  std::string name_;
  std::map<std::string, ParameterValue> overrides_;
  std::map<std::string, bool> declared_;
  Clock::SharedPtr clock_;
};

template<typename NodeT, typename CallbackT>
TimerBase::SharedPtr create_timer(NodeT, Clock::SharedPtr clock, Duration period, CallbackT && callback)
{
  auto timer = std::make_shared<TimerBase>();
  timer->period = period.nanoseconds();
  timer->next = clock->now().nanoseconds() + timer->period;
  timer->callback = callback;
  timers().push_back(timer);
  return timer;
}

inline void init(int, char **) {}
inline void spin(std::shared_ptr<Node>) {}
inline bool shutdown() {return true;}

}  // namespace rclcpp
