/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* Connects the inputs, outputs and parameters of the rig with those of the model. rig_simulink.h describes what else can be
 * defined here: a slower model, an error status, functions of another form.
 */
#include "my_model.h"
#include "rig_record.h"

#define RIG_MODEL my_model
#define RIG_LEVELS RIG_LEVEL_CURRENT
#define RIG_ERROR_STATUS (rtU.gear_request && !rtU.outputs ? "the ordered gear has no output on this rig" : NULL)
#include "rig_simulink.h"

static void rig_inputs(const rig_controller_inputs *in) {
  rtU.time = in->time;
  rtU.gear_request = (uint8_T)in->gear_request;
  rtU.outputs = (uint8_T)rig_outputs_of(in->gear_request);
  rtU.n_in = in->measured[0];
}

static void rig_outputs(rig_controller_outputs *out) {
  for (int k = 0; k < RIG_OUTPUTS; k++) out->command[k] = rtY.current[k];
  out->gear = rtY.gear;
  out->shifting = rtY.shifting;
}

static void rig_parameters(void) {
  /* e.g. rtP.t12 = rig_setting("t12"); */
}
