/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* Connects the inputs, outputs and parameters of the rig with those of the model (rig_simulink.h). */
#include "alfa46.h"

#define RIG_MODEL alfa46
#define RIG_LEVELS (RIG_LEVEL_DUTY | RIG_LEVEL_CURRENT)
#include "rig_simulink.h"

static void rig_inputs(const rig_controller_inputs *in) {
  rtU.sample = (real_T)in->sample;
  rtU.gear_request = (uint8_T)in->gear_request;
  for (int k = 0; k < 3; k++) rtU.current[k] = in->current[k];
}

static void rig_outputs(rig_controller_outputs *out) {
  for (int k = 0; k < 3; k++) {
    out->command[k] = rig_shim.level == RIG_LEVEL_CURRENT ? rtY.setpoint[k] : rtY.duty[k];
    out->setpoint[k] = rtY.setpoint[k];
    if (rtY.on[k]) out->flags |= 1u << k;
  }
  out->gear = rtY.gear;
  out->shifting = rtY.shifting;
}

static void rig_parameters(void) {
  char name[32];
  rtP.sample_time = rig_setting("sample_time");
  rtP.supply_voltage = rig_setting("supply_voltage");
  rtP.gain_p = rig_setting("gain_p");
  rtP.gain_i = rig_setting("gain_i");
  rtP.gain_d = rig_setting("gain_d");
  rtP.derivative_time = rig_setting("derivative_time");
  rtP.t12 = rig_setting("t12");
  rtP.t21 = rig_setting("t21");
  rtP.t23 = rig_setting("t23");
  rtP.t32 = rig_setting("t32");
  for (int k = 0; k < 18; k++) {
    snprintf(name, sizeof name, "output_%d.P%d.time", k / 6 + 1, k % 6 + 1);
    rtP.time[k] = rig_setting(name);
    snprintf(name, sizeof name, "output_%d.P%d.current", k / 6 + 1, k % 6 + 1);
    rtP.current[k] = rig_setting(name);
  }
}
