// Copyright 2026 Virtual rig maintainers
// SPDX-License-Identifier: Apache-2.0

// Brings the controller of my_controller.cpp to the rig as a ROS 2 node, until Ctrl-C.
#include "rig_ros.hpp"

int main(int count, char **arguments) { return rig_ros::serve(count, arguments); }
