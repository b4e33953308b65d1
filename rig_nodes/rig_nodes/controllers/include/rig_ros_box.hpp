// Copyright 2026 Virtual rig maintainers
// SPDX-License-Identifier: Apache-2.0

// Connects a controller of rig_controller.h with the rig's ROS 2 messages: it takes one message and returns one.
//
// rig_ros.hpp, the node around it, uses it (docs/how_to/ros_controller.md); it needs no rclcpp itself. It computes nothing:
// it passes each step to rig_controller_step once, and repeats the same answer when the same step arrives again.
#ifndef RIG_ROS_BOX_HPP
#define RIG_ROS_BOX_HPP

#include "rig_controller.h"

#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <random>
#include <rig_msgs/msg/controller_answer.hpp>
#include <rig_msgs/msg/controller_ready.hpp>
#include <rig_msgs/msg/controller_start.hpp>
#include <rig_msgs/msg/controller_step.hpp>
#include <string>
#include <utility>
#include <vector>

// Optional functions of a controller: null when it has none.
#pragma weak rig_controller_wants
#pragma weak rig_controller_wanted
#pragma weak rig_controller_signals
#pragma weak rig_controller_signal_values
#pragma weak rig_controller_settings
#pragma weak rig_controller_set

namespace rig_ros {

using rig_msgs::msg::ControllerAnswer;
using rig_msgs::msg::ControllerReady;
using rig_msgs::msg::ControllerStart;
using rig_msgs::msg::ControllerStep;
using Names = std::vector<std::string>;

// Returns the names from one of a controller's pairs of optional functions; none when it has only one function of the pair.
inline Names names_of(const char *const *(*list)(), bool values) {
  Names out;
  if (list && values)
    for (const char *const *name = list(); *name; ++name) out.emplace_back(*name);
  return out;
}

inline Names settings_of() {
  Names out;
  if (rig_controller_settings && rig_controller_set)
    for (const rig_parameter *own = rig_controller_settings(); own->name; ++own) out.emplace_back(own->name);
  return out;
}

class Box {
 public:
  Box()
      : number_(std::random_device{}() | 1u),
        wants_(names_of(rig_controller_wants, rig_controller_wanted)),
        signals_(names_of(rig_controller_signals, rig_controller_signal_values)),
        settings_(settings_of()) {}
  ~Box() { end(); }
  Box(const Box &) = delete;
  Box &operator=(const Box &) = delete;

  // Handles the beginning or the end of a run; returns the message to send, if any.
  std::optional<ControllerReady> start(const ControllerStart &start) {
    if (start.over && start.session != start_.session) return std::nullopt;  // the end of an earlier run
    end();
    if (start.over) return std::nullopt;
    start_ = start;
    if (start.level != ControllerStart::LEVEL_CURRENT && start.level != ControllerStart::LEVEL_DUTY)
      return ready(ControllerReady::REFUSES, "the level of this run, " + std::to_string(start.level) + ", is unknown here");
    const uint32_t level = start.level == ControllerStart::LEVEL_CURRENT ? RIG_LEVEL_CURRENT : RIG_LEVEL_DUTY;
    if (!(rig_controller_abi()->levels & level))
      return ready(ControllerReady::REFUSES, std::string("this run is at level ") +
                                                 (level == RIG_LEVEL_CURRENT ? "current" : "duty") +
                                                 ", at which the controller does not work; choose with --level");
    const char *const made_for = rig_controller_abi()->record;
    if (made_for && start.record.id != made_for)
      return ready(ControllerReady::REFUSES,
                   std::string("it was made for the record ") + made_for + " of another rig, this one's is " + start.record.id +
                       "; write rig_record.h anew with ./rig export record -o rig_record.h, and compile it again");
    const std::string why = lacking();
    if (!why.empty()) return ready(ControllerReady::REFUSES, why);
    for (const std::string &name : start_.signals)
      if (!has(signals_, name))
        return ready(ControllerReady::REFUSES, "it has no signal " + name + ", which ros:NAME?signals= names");
    std::vector<rig_parameter> parameters;
    for (size_t k = 0; k < std::min(start_.parameter_names.size(), start_.parameter_values.size()); ++k)
      parameters.push_back({start_.parameter_names[k].c_str(), start_.parameter_values[k]});
    std::vector<const char *> outputs;
    for (const std::string &name : start_.record.outputs) outputs.push_back(name.c_str());
    std::vector<rig_transducer> transducers;
    for (size_t k = 0; k < std::min(start_.record.transducers.size(), start_.record.units.size()); ++k)
      transducers.push_back({start_.record.transducers[k].c_str(), start_.record.units[k].c_str()});
    std::vector<rig_gear> gears;
    for (size_t k = 0; k < std::min(start_.record.gears.size(), start_.record.gear_names.size()); ++k)
      gears.push_back({start_.record.gears[k], start_.record.gear_names[k].c_str()});
    rig_controller_info info = {};
    info.record = start_.record.id.c_str();
    info.outputs = outputs.data();
    info.transducers = transducers.data();
    info.gears = gears.data();
    info.output_count = static_cast<uint32_t>(outputs.size());
    info.transducer_count = static_cast<uint32_t>(transducers.size());
    info.gear_count = static_cast<uint32_t>(gears.size());
    info.size = sizeof info;
    info.level = level;
    info.period = start.period;
    info.command_high = start.command_high;
    info.parameters = parameters.data();
    info.parameter_count = static_cast<uint32_t>(parameters.size());
    if (rig_controller_create(&info, &instance_) != RIG_OK)
      return ready(ControllerReady::REFUSES, std::string("create failed: ") + info.message);
    running_ = true;
    answer_ = ControllerAnswer();
    return ready(ControllerReady::READY, "");
  }

  // Returns the answer to a step, or null when the step is for another controller. The answer is valid until the next step.
  const ControllerAnswer *step(const ControllerStep &step) {
    if (!running_ || step.session != start_.session || (step.controller && step.controller != number_)) return nullptr;
    if (step.seq > answer_.seq) compute(step);
    return step.seq == answer_.seq ? &answer_ : nullptr;
  }

  // Returns the message to send when this controller ends; nothing without a run.
  std::optional<ControllerReady> leave(const std::string &why) {
    if (!running_) return std::nullopt;
    end();
    return ready(ControllerReady::LEAVES, why);
  }

 private:
  static bool has(const Names &names, const std::string &name) {
    return std::find(names.begin(), names.end(), name) != names.end();
  }

  // Returns the reason to refuse the run: all of the controller's own names that the rig does not have; empty if it has all.
  std::string lacking() const {
    std::string names, options;
    const auto look = [&](const Names &own, const Names &of_the_rig, const std::string &option, const std::string &more) {
      Names all = of_the_rig;
      for (const std::string &name : own)
        if (!has(of_the_rig, name)) {
          names += (names.empty() ? "" : ", ") + name;
          all.push_back(name);
        }
      for (size_t k = 0; k < all.size() && !own.empty(); ++k)
        options += (k ? "," : (options.empty() ? "" : "&") + option) + all[k] + more;
    };
    look(wants_, start_.wants, "wants=", "");
    look(settings_, start_.settings, "settings=", ":VALUE");
    look(signals_, start_.signals, "signals=", "");
    return names.empty() ? "" : "it needs " + names + "; start the rig with ros:NAME?" + options;
  }

  // Returns the values of `names`, all of which are among the names `of` that `values` belong to.
  static std::vector<double> picked(const Names &names, const Names &of, const std::vector<double> &values) {
    std::vector<double> out;
    for (const std::string &name : names)
      out.push_back(values.at(static_cast<size_t>(std::find(of.begin(), of.end(), name) - of.begin())));
    return out;
  }

  ControllerReady ready(uint8_t state, const std::string &message) const {
    ControllerReady out;
    out.session = start_.session;
    out.controller = number_;
    out.state = state;
    out.levels = static_cast<uint8_t>(rig_controller_abi()->levels);
    out.process_id = static_cast<uint32_t>(getpid());
    char place[64];
    const ssize_t length = readlink("/proc/self/ns/pid", place, sizeof place);
    out.pid_namespace.assign(place, length > 0 ? static_cast<size_t>(length) : 0u);
    out.message = message;
    return out;
  }

  // Returns whether a step has as many numbers as the start of the run has names.
  bool fits(const ControllerStep &step) const {
    return step.current.size() == start_.record.outputs.size() && step.measured.size() == start_.record.transducers.size() &&
           step.others.size() == start_.wants.size() && step.settings.size() == start_.settings.size();
  }

  // Returns a sentence on the first number that a message cannot hold, and would carry as another one; empty if it can hold all.
  static std::string beyond_a_byte(const std::vector<std::pair<std::string, int64_t>> &numbers) {
    for (const auto &[name, value] : numbers)
      if (value < 0 || value > 255) return name + " is " + std::to_string(value) + ", expected 0 to 255";
    return "";
  }

  void compute(const ControllerStep &step) {
    answer_.session = step.session;
    answer_.controller = number_;
    answer_.seq = step.seq;
    if (!fits(step)) {
      answer_.status = RIG_ERROR;
      answer_.message = "the step has other numbers than the start of the run has names";
      return;
    }
    rig_controller_inputs in = {};
    in.size = sizeof in;
    in.gear_request = step.gear_request;
    in.sample = step.sample;
    in.time = step.time;
    in.current = step.current.data();
    in.measured = step.measured.data();
    if (!wants_.empty()) {
      const auto values = picked(wants_, start_.wants, step.others);
      rig_controller_wanted(instance_, values.data(), static_cast<uint32_t>(values.size()));
    }
    if (!settings_.empty()) {
      const auto values = picked(settings_, start_.settings, step.settings);
      rig_controller_set(instance_, values.data(), static_cast<uint32_t>(values.size()));
    }
    rig_controller_outputs out = {};
    answer_.command.assign(step.current.size(), 0.0);
    answer_.setpoint.assign(step.current.size(), 0.0);
    out.size = sizeof out;
    out.command = answer_.command.data();
    out.setpoint = answer_.setpoint.data();
    const int status = rig_controller_step(instance_, &in, &out);
    answer_.status = static_cast<uint8_t>(status);
    answer_.gear = static_cast<uint8_t>(out.gear);
    answer_.shifting = out.shifting != 0;
    answer_.flags = static_cast<uint8_t>(out.flags);
    out.message[RIG_CONTROLLER_TEXT - 1] = '\0';
    answer_.message = out.message;
    const std::string beyond = beyond_a_byte({{"status", status}, {"gear", out.gear}, {"flags", out.flags}});
    if (!beyond.empty()) {
      answer_.status = RIG_ERROR;
      answer_.message = beyond;
    }
    answer_.signals.clear();
    if (!signals_.empty() && status == RIG_OK) {
      std::vector<double> values(signals_.size());
      rig_controller_signal_values(instance_, values.data(), static_cast<uint32_t>(values.size()));
      answer_.signals = picked(start_.signals, signals_, values);
    }
  }

  void end() {
    if (running_) rig_controller_destroy(instance_);
    running_ = false;
  }

  const uint32_t number_;  // distinguishes this controller from others on the same topics
  const Names wants_, signals_, settings_;
  ControllerStart start_;
  ControllerAnswer answer_;
  void *instance_ = nullptr;
  bool running_ = false;
};

}  // namespace rig_ros

#endif
