/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* A placeholder for the file that Simulink Coder generates. Replace it with your generated files and change rig_shim.c
 * accordingly.
 *
 * The old clutch is held until the new one is filled, and then released; the new one gets a plateau of current, then a
 * ramp.
 */
#include "my_model.h"

ExtU rtU;
ExtY rtY;

static uint8_T on, off; /* outputs of the gear and of the one before */
static real_T since;

void my_model_initialize(void) {
  rtY.gear = 0U;
  on = off = 0U;
  since = -10.0; /* no shift is running */
}

void my_model_step(void) {
  real_T elapsed, wanted;
  int k;
  if (rtU.gear_request != rtY.gear) {
    off = on;
    on = rtU.outputs;
    rtY.gear = rtU.gear_request;
    since = rtU.time;
  }
  elapsed = rtU.time - since;
  wanted = elapsed < 0.3 ? 0.22 : 0.22 + 1.2 * (elapsed - 0.3);
  if (wanted > 0.74) {
    wanted = 0.74;
  }
  for (k = 0; k < 8; k++) {
    rtY.current[k] = 0.0;
    if (on >> k & 1) {
      rtY.current[k] = off >> k & 1 ? 0.74 : wanted; /* a clutch of both gears stays held */
    } else if (off >> k & 1 && elapsed < 0.55) {
      rtY.current[k] = elapsed < 0.35 ? 0.74 : 0.13;
    }
  }
  rtY.shifting = (boolean_T)(elapsed < 1.5);
}

void my_model_terminate(void) {
  /* there is nothing to free */
}
