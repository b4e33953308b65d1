// Copyright 2026 Virtual rig maintainers
// SPDX-License-Identifier: Apache-2.0

// Runs the controller of my_controller.cpp as a ROS 2 node that the rig can use, until Ctrl-C.
#include "rig_ros.hpp"

int main(int count, char **arguments) { return rig_ros::serve(count, arguments); }
