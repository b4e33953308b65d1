// Copyright 2026 Virtual rig maintainers
// SPDX-License-Identifier: Apache-2.0

// The Alfa46 law of alfa46.c as a ROS 2 node of its own.
//
//   ros2 run alfa46_cpp alfa46_node [NAME]              (in one terminal; docs/how_to/ros_controller.md describes the build)
//   ./rig simulate demo --controller ros:               (in another with the same ROS_DOMAIN_ID, before or after; or ros:NAME)
#include "rig_ros.hpp"

int main(int count, char **arguments) { return rig_ros::serve(count, arguments); }
