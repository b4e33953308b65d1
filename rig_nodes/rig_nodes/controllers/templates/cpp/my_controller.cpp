// Copyright 2026 Virtual rig maintainers
// SPDX-License-Identifier: Apache-2.0

// A shift controller of your own. Every 1 ms it computes the current setpoints from the same inputs as the real controller.
//
// The old clutch is held until the new one is filled, and then released; the new one gets a plateau of current, then a
// ramp. Change this as you like.
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
    const double wanted = std::min(kPlateau + kSlope * std::max(0.0, elapsed - kFill), held_);
    const uint32_t on = rig_outputs_of(gear_), off = rig_outputs_of(old_);
    for (uint32_t k = 0; k < RIG_OUTPUTS; k++) {
      if (on >> k & 1) {
        out.command[k] = off >> k & 1 ? held_ : wanted;  // a clutch of both gears stays held
      } else if (off >> k & 1 && elapsed < kOverlap + 0.2) {
        out.command[k] = elapsed < kOverlap ? held_ : kRelease;
      }
    }
    out.gear = gear_;
    out.shifting = elapsed < 1.5;
  }

 private:
  static constexpr double kFill = 0.30, kPlateau = 0.22, kSlope = 1.2;  // s, A, A/s
  static constexpr double kOverlap = 0.35, kRelease = 0.13;             // s during which both are on; A of the old one after that
  double held_;                                                         // A
  uint32_t gear_ = 0, old_ = 0;
  double since_ = -10.0;  // no shift is running
};

}  // namespace

// The commands of step are current setpoints in A; with RIG_LEVEL_DUTY they would be duties from 0 to 1.
const rig_controller_abi_info *rig_controller_abi() { RIG_CONTROLLER_DESCRIBE(RIG_LEVEL_CURRENT); }

int rig_controller_create(rig_controller_info *info, void **instance) {
  if (info->size != sizeof *info) return RIG_ERROR;
  *instance = std::make_unique<MyController>(*info).release();
  return RIG_OK;
}

// No exception may leave this function, because its caller is written in C.
int rig_controller_step(void *instance, const rig_controller_inputs *in, rig_controller_outputs *out) {
  if (in->gear_request && !rig_outputs_of(in->gear_request)) {
    std::snprintf(out->message, sizeof out->message, "gear %u has no output on this rig", (unsigned)in->gear_request);
    return RIG_ERROR;
  }
  try {
    static_cast<MyController *>(instance)->step(*in, *out);
    return RIG_OK;
  } catch (const std::exception &error) {
    std::snprintf(out->message, sizeof out->message, "%s", error.what());
    return RIG_ERROR;
  }
}

void rig_controller_destroy(void *instance) { delete static_cast<MyController *>(instance); }
