// Copyright 2026 Virtual rig maintainers
// SPDX-License-Identifier: Apache-2.0

// A shift controller behind rig_controller.h as a ROS 2 node: the controller's side of docs/how_to/ros_controller.md in C++.
//
// Link it with the functions of rig_controller.h and call rig_ros::serve; examples/ros_cpp is a whole package. A program with other
// work to do makes a rig_ros::Node and spins it itself.
#ifndef RIG_ROS_HPP
#define RIG_ROS_HPP

#include "rig_ros_box.hpp"

#include <chrono>
#include <csignal>
#include <memory>
#include <rclcpp/rclcpp.hpp>
#include <string>
#include <vector>

namespace rig_ros {

class Node : public rclcpp::Node {
 public:
  // topics: NAME of the rig's --controller ros:NAME
  explicit Node(const std::string &topics = "controller", const std::string &name = "my_controller")
      : rclcpp::Node(name) {
    const rclcpp::QoS lasting = rclcpp::QoS(1).transient_local();
    ready_ = create_publisher<ControllerReady>("/" + topics + "/ready", lasting);
    answer_ = create_publisher<ControllerAnswer>("/" + topics + "/answer", rclcpp::QoS(1));
    // best effort: the rig repeats a step without an answer, and acknowledging each step would take a third of the step's time
    step_ = create_subscription<ControllerStep>("/" + topics + "/step", rclcpp::QoS(1).best_effort(),
                                                [this](const ControllerStep &step) {
                                                  if (const ControllerAnswer *answer = box_.step(step))
                                                    answer_->publish(*answer);
                                                });
    // the depth of a reader counts the messages of all writers: the end of one rig's run must not displace the start of the next
    const rclcpp::QoS from_many = rclcpp::QoS(10).transient_local();
    start_ = create_subscription<ControllerStart>("/" + topics + "/start", from_many,
                                                  [this](const ControllerStart &start) {
                                                    if (const auto said = box_.start(start)) ready_->publish(*said);
                                                  });
  }

  // Report the end of this controller during a run, and wait until the rig has received the report.
  void leave(const std::string &why) {
    if (const auto said = box_.leave(why)) {
      ready_->publish(*said);
      ready_->wait_for_all_acked(std::chrono::milliseconds(500));
    }
  }

 private:
  Box box_;
  rclcpp::Publisher<ControllerReady>::SharedPtr ready_;
  rclcpp::Publisher<ControllerAnswer>::SharedPtr answer_;
  rclcpp::Subscription<ControllerStep>::SharedPtr step_;
  rclcpp::Subscription<ControllerStart>::SharedPtr start_;
};

inline volatile std::sig_atomic_t stopped = 0;  // number of the signal that ended the program

// Answer the rig until Ctrl-C, and return the exit code. Rig and node may start in any order. The first argument that is not an
// argument of ROS is the NAME of ros:NAME.
inline int serve(int count, char **arguments) {
  const std::vector<std::string> words = rclcpp::remove_ros_arguments(count, arguments);
  rclcpp::init(count, arguments, rclcpp::InitOptions(), rclcpp::SignalHandlerOptions::None);
  for (const int number : {SIGINT, SIGTERM}) std::signal(number, [](int asked) { stopped = asked; });
  {
    const auto node = std::make_shared<Node>(words.size() > 1 ? words[1] : "controller");
    rclcpp::executors::SingleThreadedExecutor executor;
    executor.add_node(node);
    while (!stopped) executor.spin_once(std::chrono::milliseconds(100));
    node->leave("the controller was stopped");
  }
  rclcpp::shutdown();
  return stopped == SIGINT ? 130 : 0;
}

}  // namespace rig_ros

#endif
