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

static uint8_T old;
static real_T since;

void my_model_initialize(void) {
  rtY.gear = 0U;
  old = 0U;
  since = -10.0; /* no shift is running */
}

void my_model_step(void) {
  real_T wanted[2] = {0.0, 0.0};
  real_T elapsed;
  if (rtU.gear_request <= 2U && rtU.gear_request != rtY.gear) { /* this model has outputs for two gears */
    old = rtY.gear;
    rtY.gear = rtU.gear_request;
    since = rtU.time;
  }
  elapsed = rtU.time - since;
  if (old > 0U && elapsed < 0.55) {
    wanted[old - 1] = elapsed < 0.35 ? 0.74 : 0.13;
  }
  if (rtY.gear > 0U) {
    wanted[rtY.gear - 1] = elapsed < 0.3 ? 0.22 : 0.22 + 1.2 * (elapsed - 0.3);
    if (wanted[rtY.gear - 1] > 0.74) {
      wanted[rtY.gear - 1] = 0.74;
    }
  }
  rtY.current_1 = wanted[0];
  rtY.current_2 = wanted[1];
  rtY.shifting = (boolean_T)(elapsed < 1.5);
}

void my_model_terminate(void) {
  /* there is nothing to free */
}
