// Copyright 2026 Virtual rig maintainers
// SPDX-License-Identifier: Apache-2.0

// A shift controller of your own: current setpoints in steps of 1 ms, from what the wires carry.
//
// The old clutch is held until the new one is filled, then let go; the new one gets a plateau, then a ramp. Change it.
#include "rig_record.h"

#include <algorithm>
#include <cstdio>
#include <exception>
#include <memory>

namespace {

class MyController {
 public:
  explicit MyController(const rig_controller_info &info) : held_(std::min(0.74, info.command_high)) {}

  void step(const rig_controller_inputs &in, rig_controller_outputs &out) {
    if (in.gear_request != gear_) {
      old_ = gear_;
      gear_ = in.gear_request;
      since_ = in.time;
    }
    const double elapsed = in.time - since_;
    if (old_ && elapsed < kOverlap + 0.2) out.command[old_ - 1] = elapsed < kOverlap ? held_ : kRelease;
    if (gear_) out.command[gear_ - 1] = std::min(kPlateau + kSlope * std::max(0.0, elapsed - kFill), held_);
    out.gear = gear_;
    out.shifting = elapsed < 1.5;
  }

 private:
  static constexpr double kFill = 0.30, kPlateau = 0.22, kSlope = 1.2;  // s, A, A/s
  static constexpr double kOverlap = 0.25, kRelease = 0.13;             // s in which both are on; A of the old one then
  double held_;                                                         // A
  uint32_t gear_ = 0, old_ = 0;
  double since_ = -10.0;  // no shift is running
};

}  // namespace

// What step returns: setpoints in A; RIG_LEVEL_DUTY would be 0 to 1.
const rig_controller_abi_info *rig_controller_abi() { RIG_CONTROLLER_DESCRIBE(RIG_LEVEL_CURRENT); }

int rig_controller_create(rig_controller_info *info, void **instance) {
  if (info->size != sizeof *info) return RIG_ERROR;
  *instance = std::make_unique<MyController>(*info).release();
  return RIG_OK;
}

// No exception may leave it: C has none.
int rig_controller_step(void *instance, const rig_controller_inputs *in, rig_controller_outputs *out) {
  if (in->gear_request > RIG_OUTPUTS) return RIG_ERROR;
  try {
    static_cast<MyController *>(instance)->step(*in, *out);
    return RIG_OK;
  } catch (const std::exception &error) {
    std::snprintf(out->message, sizeof out->message, "%s", error.what());
    return RIG_ERROR;
  }
}

void rig_controller_destroy(void *instance) { delete static_cast<MyController *>(instance); }
