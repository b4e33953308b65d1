/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* A shift controller of your own. Every 1 ms it computes the current setpoints from the same inputs as the real controller.
 *
 * The old clutch is held until the new one is filled, and then released; the new one gets a plateau of current, then a
 * ramp. Change this as you like. The controller runs in a process of its own, so static variables serve as well as a
 * structure behind `instance`.
 */
#include "rig_record.h"

#include <stdio.h>

static const double FILL = 0.30, PLATEAU = 0.22, SLOPE = 1.2, HELD = 0.74; /* s, A, A/s, A */
static const double OVERLAP = 0.35, RELEASE = 0.13; /* s during which both clutches are on; A of the old one after that */

static uint32_t gear, old;
static double since;

/* The commands of step are current setpoints in A; with RIG_LEVEL_DUTY they would be duties from 0 to 1. */
const rig_controller_abi_info *rig_controller_abi(void) { RIG_CONTROLLER_DESCRIBE(RIG_LEVEL_CURRENT); }

int rig_controller_create(rig_controller_info *info, void **instance) {
  if (info->size != sizeof *info) return RIG_ERROR;
  *instance = NULL;
  gear = old = 0;
  since = -10.0; /* no shift is running */
  return RIG_OK;
}

int rig_controller_step(void *instance, const rig_controller_inputs *in, rig_controller_outputs *out) {
  uint32_t k, on, off;
  double elapsed, wanted;
  (void)instance;
  if (in->gear_request && !rig_outputs_of(in->gear_request)) {
    snprintf(out->message, sizeof out->message, "gear %u has no output on this rig", (unsigned)in->gear_request);
    return RIG_ERROR;
  }
  if (in->gear_request != gear) {
    old = gear;
    gear = in->gear_request;
    since = in->time;
  }
  elapsed = in->time - since;
  wanted = PLATEAU + (elapsed > FILL ? SLOPE * (elapsed - FILL) : 0.0);
  if (wanted > HELD) wanted = HELD;
  on = rig_outputs_of(gear);
  off = rig_outputs_of(old);
  for (k = 0; k < RIG_OUTPUTS; k++) {
    if (on >> k & 1) {
      out->command[k] = off >> k & 1 ? HELD : wanted; /* a clutch of both gears stays held */
    } else if (off >> k & 1 && elapsed < OVERLAP + 0.2) {
      out->command[k] = elapsed < OVERLAP ? HELD : RELEASE;
    }
  }
  out->gear = gear;
  out->shifting = elapsed < 1.5;
  return RIG_OK;
}

void rig_controller_destroy(void *instance) { (void)instance; }
