/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* A shift controller of rig_controller.h as the model of an FMU, with the controller's inputs, outputs and named parameters.
 *
 * Its step from t to t + 1 ms computes the answer to the sample at t. An importer that passes the answer to the rig at t + 1 ms
 * reproduces the rig's delay of one sample. variables.h gives the places of these values: MODEL_LEVEL, MODEL_LIMIT
 * (current_limit), MODEL_RECORD (rig_record), MODEL_INPUTS (first of gear_request, MODEL_VALVES currents, MODEL_TRANSDUCERS of
 * the rig's record, then MODEL_WANTS further transducers), MODEL_OUTPUTS (first of as many commands and setpoints, gear, shifting,
 * flags, status, then MODEL_SIGNALS signals of the controller's own) and MODEL_TUNABLE (first of MODEL_SETTINGS settings of its
 * own). It also defines MODEL_ID, MODEL_VALVE_NAMES, MODEL_TRANSDUCER_LIST and MODEL_GEARS.
 */
#include "rig_controller.h"

#include "model.h" /* after the line above, because variables.h uses its types */

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The optional functions of rig_controller.h. */
extern void rig_controller_wanted(void *instance, const double *values, uint32_t count) __attribute__((weak));
extern void rig_controller_signal_values(void *instance, double *values, uint32_t count) __attribute__((weak));
extern void rig_controller_set(void *instance, const double *values, uint32_t count) __attribute__((weak));
extern uint32_t rig_controller_save(void *instance, void *bytes) __attribute__((weak));
extern int rig_controller_load(void *instance, const void *bytes, uint32_t size) __attribute__((weak));

enum { GEAR = 2 * MODEL_VALVES, SHIFTING, FLAGS, STATUS, TOLD }; /* places from MODEL_OUTPUTS on; TOLD is their number */

struct model {
  model_values *values;
  model_say say;
  void *importer;
  void *controller;
  int alive; /* a controller exists, which destroy has to free */
};

model *model_new(const char *resources, model_values *values, model_say say, void *importer) {
  model *m = calloc(1, sizeof *m);
  (void)resources;
  if (!m) return NULL;
  m->values = values;
  m->say = say;
  m->importer = importer;
  return m;
}

static void end(model *m) {
  if (m->alive) rig_controller_destroy(m->controller);
  m->alive = 0;
}

int model_initialize(model *m) {
  rig_parameter parameters[MODEL_COUNT];
  rig_controller_info info;
  double *number = m->values->number;
  uint32_t count = 0;
  int status;
  end(m);
  for (unsigned k = 0; k < MODEL_COUNT; k++) {
    if (MODEL_KINDS[k] != 'p' || k == MODEL_LEVEL || k == MODEL_RECORD) continue;
    parameters[count].name = MODEL_NAMES[k];
    parameters[count++].value = number[k];
  }
  memset(&info, 0, sizeof info);
  info.size = sizeof info;
  info.level = number[MODEL_LEVEL] != 0.0 ? RIG_LEVEL_CURRENT : RIG_LEVEL_DUTY;
  info.period = MODEL_SAMPLE;
  info.command_high = info.level == RIG_LEVEL_CURRENT ? number[MODEL_LIMIT] : 1.0;
  info.parameters = parameters;
  info.parameter_count = count;
  info.record = MODEL_ID;
  info.outputs = MODEL_VALVE_NAMES;
  info.transducers = MODEL_TRANSDUCER_LIST;
  info.gears = MODEL_GEARS;
  info.output_count = MODEL_VALVES;
  info.transducer_count = MODEL_TRANSDUCERS;
  info.gear_count = sizeof MODEL_GEARS / sizeof *MODEL_GEARS;
  if (!(rig_controller_abi()->levels & info.level)) {
    m->say(m->importer, MODEL_ERROR, "the controller does not work at the given level");
    return MODEL_ERROR;
  }
  status = rig_controller_create(&info, &m->controller);
  if (status != RIG_OK) {
    info.message[sizeof info.message - 1] = 0;
    m->say(m->importer, MODEL_ERROR,
           info.message[0] ? info.message : "the controller refused to start and gave no reason");
    return MODEL_ERROR;
  }
  m->alive = 1;
  for (unsigned k = MODEL_OUTPUTS; k < MODEL_COUNT; k++) number[k] = 0.0;
  return MODEL_OK;
}

int model_step(model *m, unsigned long sample, unsigned samples, unsigned *done) {
  double *number = m->values->number;
  const double *given = number + MODEL_INPUTS;
  double *told = number + MODEL_OUTPUTS;
  rig_controller_inputs in;
  rig_controller_outputs out;
  double command[MODEL_VALVES], setpoint[MODEL_VALVES];
  for (unsigned n = 0; n < samples; n++) {
    int status;
    memset(&in, 0, sizeof in);
    memset(&out, 0, sizeof out);
    in.size = sizeof in;
    out.size = sizeof out;
    in.gear_request = (uint32_t)given[0];
    in.sample = sample + n;
    in.time = (double)in.sample * MODEL_SAMPLE;
    in.current = given + 1;
    in.measured = given + 1 + MODEL_VALVES;
    memset(command, 0, sizeof command);
    memset(setpoint, 0, sizeof setpoint);
    out.command = command;
    out.setpoint = setpoint;
    if (MODEL_WANTS) rig_controller_wanted(m->controller, given + 1 + MODEL_VALVES + MODEL_TRANSDUCERS, MODEL_WANTS);
    if (MODEL_SETTINGS) rig_controller_set(m->controller, number + MODEL_TUNABLE, MODEL_SETTINGS);
    status = rig_controller_step(m->controller, &in, &out);
    told[STATUS] = status == RIG_DISCARD; /* fmi2Discard would mean that the step was not computed */
    out.message[sizeof out.message - 1] = 0;
    if (status == RIG_DISCARD) {
      if (out.message[0]) m->say(m->importer, MODEL_WARNING, out.message);
      continue;
    }
    if (status != RIG_OK) {
      if (status != RIG_ERROR) m->alive = 0; /* none of its functions may be called again */
      status = status == RIG_ERROR ? MODEL_ERROR : MODEL_FATAL;
      m->say(m->importer, status, out.message[0] ? out.message : "the controller gave no reason");
      return status;
    }
    memcpy(told, command, sizeof command);
    memcpy(told + MODEL_VALVES, setpoint, sizeof setpoint);
    told[GEAR] = out.gear;
    told[SHIFTING] = out.shifting != 0;
    told[FLAGS] = out.flags;
    if (MODEL_SIGNALS) rig_controller_signal_values(m->controller, told + TOLD, MODEL_SIGNALS);
  }
  *done = samples;
  return MODEL_OK;
}

int model_terminate(model *m) {
  end(m);
  return MODEL_OK;
}

int model_reset(model *m) {
  end(m);
  return MODEL_OK;
}

int model_save(model *m, unsigned char **bytes, size_t *size) {
  const char *why = "there is no memory for the state";
  *bytes = NULL;
  *size = 0;
  if (rig_controller_save && rig_controller_load) {
    if (!m->alive) return MODEL_OK;
    *size = rig_controller_save(m->controller, NULL);
    if (*size) *bytes = calloc(1, *size);
    if (*bytes && rig_controller_save(m->controller, *bytes) == *size) return MODEL_OK;
    if (*bytes || !*size) why = "rig_controller_save returned another size than before, or 0";
    free(*bytes);
    *bytes = NULL;
  } else {
    why = "the controller has no rig_controller_save and rig_controller_load, so its state cannot be saved";
  }
  m->say(m->importer, MODEL_ERROR, why);
  return MODEL_ERROR;
}

int model_restore(model *m, const unsigned char *bytes, size_t size) {
  int status;
  end(m);
  if (!size) return MODEL_OK;
  status = model_initialize(m); /* a new one, with the parameters of the one that was saved */
  if (status != MODEL_OK) return status;
  if (rig_controller_load && rig_controller_load(m->controller, bytes, (uint32_t)size) == RIG_OK) return MODEL_OK;
  m->say(m->importer, MODEL_ERROR, "the controller refuses the state");
  return MODEL_ERROR;
}

void model_free(model *m) {
  end(m);
  free(m);
}
