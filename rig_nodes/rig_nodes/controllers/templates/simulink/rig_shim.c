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
#include "rig_simulink.h"

static void rig_inputs(const rig_controller_inputs *in) {
  rtU.time = in->time;
  rtU.gear_request = (uint8_T)in->gear_request;
  rtU.speed = in->measured[0]; /* by name: rig_measured_of(in)->..., see rig_record.h */
}

static void rig_outputs(rig_controller_outputs *out) {
  out->command[0] = rtY.current_1;
  out->command[1] = rtY.current_2;
  out->gear = rtY.gear;
  out->shifting = rtY.shifting;
}

static void rig_parameters(void) {
  /* e.g. rtP.t12 = rig_setting("t12"); */
}
