/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* Makes a shift controller (rig_controller.h) from code that Simulink Coder or Embedded Coder has generated, with the functions
 * MODEL_initialize, MODEL_step and MODEL_terminate and the global structures rtU and rtY.
 *
 * Write one file rig_shim.c, or rig_shim.cpp for C++ code, beside the generated files or their folders
 * (`./rig controller new simulink DIR` writes one):
 *
 *   #include "my_model.h"
 *   #include "rig_record.h"
 *   #define RIG_MODEL my_model
 *   #define RIG_LEVELS RIG_LEVEL_CURRENT
 *   #include "rig_simulink.h"
 *
 *   static void rig_inputs(const rig_controller_inputs *in) { rtU.gear_request = (uint8_T)in->gear_request; ... }
 *   static void rig_outputs(rig_controller_outputs *out) {
 *     for (int k = 0; k < RIG_OUTPUTS; k++) out->command[k] = rtY.current[k];
 *     out->gear = rtY.gear; out->shifting = rtY.shifting;
 *   }
 *   static void rig_parameters(void) { rtP.t12 = rig_setting("t12"); ... }
 *
 * Macros that may be defined before this file is included:
 *   RIG_MODEL_PERIOD     base sample time of the model [s], a whole multiple of the rig's 0.001; without it the
 *                        model makes a step in each sample. A slower model keeps its outputs between its steps.
 *   RIG_INITIALIZE()     RIG_STEP() RIG_TERMINATE(): calls of another form, e.g. with a model structure as argument,
 *                        or with one step for each rate (step0, step1 ... or step(tid)) or its inputs and outputs as
 *                        arguments: then of a function of yours that calls them (docs/how_to/controllers.md). Defined
 *                        as nothing where the code has no such function.
 *   RIG_ERROR_STATUS     expression of type const char *, e.g. rtmGetErrorStatus(my_model_M): NULL is no error.
 *   RIG_WANTS            names of further transducers, "NAME", "NAME": rig_inputs finds their SI values in rig_wanted[0]
 *                        and rig_wanted[1]
 *   RIG_SIGNALS          names of the model's own signals that are to be recorded, e.g. "slip", "state"; then one more
 *                        function, static void rig_signals(double *values) { values[0] = rtDW.slip; ... }
 *   RIG_SETTINGS         parameters of the model that a sequence may set while it runs, with first values, e.g.
 *                        {"gain", 2.0}, {"limit", 0.7}; then one more function, called before each step of the model,
 *                        static void rig_settings(const double *values) { rtP.gain = values[0]; ... }
 */
#ifndef RIG_SIMULINK_H
#define RIG_SIMULINK_H

#include "rig_controller.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#if !defined(RIG_MODEL) || !defined(RIG_LEVELS)
#error "define RIG_MODEL (name of the model) and RIG_LEVELS (RIG_LEVEL_DUTY, RIG_LEVEL_CURRENT or both with |) first"
#endif

#define RIG_PASTE(model_, function_) model_##_##function_
#define RIG_CALL(model_, function_) RIG_PASTE(model_, function_)
#ifndef RIG_INITIALIZE
#define RIG_INITIALIZE() RIG_CALL(RIG_MODEL, initialize)()
#endif
#ifndef RIG_STEP
#define RIG_STEP() RIG_CALL(RIG_MODEL, step)()
#endif
#ifndef RIG_TERMINATE
#define RIG_TERMINATE() RIG_CALL(RIG_MODEL, terminate)()
#endif
#ifndef RIG_ERROR_STATUS
#define RIG_ERROR_STATUS NULL
#endif

/* The three functions that rig_shim.c defines. */
static void rig_inputs(const rig_controller_inputs *in);
static void rig_outputs(rig_controller_outputs *out);
static void rig_parameters(void);

static struct {
  rig_controller_info *info; /* during create only */
  uint32_t level;            /* RIG_LEVEL_... of this run */
  uint32_t highest;          /* largest number of a gear */
  unsigned long every, count;/* samples per step of the model, samples since the last */
  int created;
} rig_shim;

#define RIG_COUNT(list_) ((uint32_t)(sizeof(list_) / sizeof *(list_)) - 1u)

#ifdef RIG_WANTS
static const char *const rig_wanted_names[] = {RIG_WANTS, NULL};
static double rig_wanted[RIG_COUNT(rig_wanted_names)];

const char *const *rig_controller_wants(void) { return rig_wanted_names; }

void rig_controller_wanted(void *instance, const double *values, uint32_t count) {
  (void)instance;
  if (count == RIG_COUNT(rig_wanted_names)) memcpy(rig_wanted, values, sizeof rig_wanted);
}
#endif

#ifdef RIG_SIGNALS
static void rig_signals(double *values);

static const char *const rig_signal_names[] = {RIG_SIGNALS, NULL};

const char *const *rig_controller_signals(void) { return rig_signal_names; }

void rig_controller_signal_values(void *instance, double *values, uint32_t count) {
  (void)instance;
  if (count == RIG_COUNT(rig_signal_names)) rig_signals(values);
}
#endif

#ifdef RIG_SETTINGS
static void rig_settings(const double *values);

static const rig_parameter rig_setting_names[] = {RIG_SETTINGS, {NULL, 0.0}};
static double rig_set_values[RIG_COUNT(rig_setting_names)];

const rig_parameter *rig_controller_settings(void) { return rig_setting_names; }

void rig_controller_set(void *instance, const double *values, uint32_t count) {
  (void)instance;
  if (count == RIG_COUNT(rig_setting_names)) memcpy(rig_set_values, values, sizeof rig_set_values);
}
#endif

/* Returns a setting of the rig's Alfa46 [SI] by its name, e.g. "output_1.P1.time"; if there is none, create fails. */
static double rig_setting(const char *name) {
  rig_controller_info *info = rig_shim.info;
  for (uint32_t k = 0; k < info->parameter_count; k++)
    if (strcmp(info->parameters[k].name, name) == 0) return info->parameters[k].value;
  if (!info->message[0]) snprintf(info->message, sizeof info->message, "parameter %s is not given", name);
  return 0.0;
}

const rig_controller_abi_info *rig_controller_abi(void) {
  (void)rig_setting; /* it may stay unused */
  RIG_CONTROLLER_DESCRIBE(RIG_LEVELS);
}

int rig_controller_create(rig_controller_info *info, void **instance) {
  const char *error;
  if (info->size != sizeof *info) return RIG_ERROR;
  if (rig_shim.created) {
    snprintf(info->message, sizeof info->message, "the model's variables are global: there can be one controller only");
    return RIG_ERROR;
  }
  rig_shim.every = 1;
#ifdef RIG_MODEL_PERIOD
  {
    const double steps = (RIG_MODEL_PERIOD) / info->period;
    if (!(steps > 0.999) || fabs(steps - floor(steps + 0.5)) > 1e-6) {
      snprintf(info->message, sizeof info->message, "the model's %g s are no whole multiple of the rig's %g s",
               (double)(RIG_MODEL_PERIOD), info->period);
      return RIG_ERROR;
    }
    rig_shim.every = (unsigned long)floor(steps + 0.5);
  }
#endif
  rig_shim.count = 0;
  rig_shim.level = info->level;
  rig_shim.highest = 0;
  for (uint32_t k = 0; k < info->gear_count; k++)
    if (info->gears[k].number > rig_shim.highest) rig_shim.highest = info->gears[k].number;
  rig_shim.info = info;
  rig_parameters();
  rig_shim.info = NULL;
  if (info->message[0]) return RIG_ERROR;
  RIG_INITIALIZE();
  error = RIG_ERROR_STATUS;
  if (error) {
    snprintf(info->message, sizeof info->message, "%s", error);
    return RIG_ERROR;
  }
  rig_shim.created = 1;
  *instance = &rig_shim;
  return RIG_OK;
}

int rig_controller_step(void *instance, const rig_controller_inputs *inputs, rig_controller_outputs *outputs) {
  const char *error;
  (void)instance;
  if (inputs->size != sizeof *inputs || outputs->size != sizeof *outputs) return RIG_FATAL;
  if (inputs->gear_request > rig_shim.highest) {
    snprintf(outputs->message, sizeof outputs->message, "there is no gear %u", (unsigned)inputs->gear_request);
    return RIG_ERROR;
  }
  if (rig_shim.count == 0) {
    rig_inputs(inputs);
#ifdef RIG_SETTINGS
    rig_settings(rig_set_values);
#endif
    RIG_STEP();
  }
  rig_shim.count = (rig_shim.count + 1) % rig_shim.every;
  error = RIG_ERROR_STATUS;
  if (error) {
    snprintf(outputs->message, sizeof outputs->message, "%s", error);
    return RIG_ERROR;
  }
  rig_outputs(outputs);
  return RIG_OK;
}

void rig_controller_destroy(void *instance) {
  (void)instance;
  RIG_TERMINATE();
  rig_shim.created = 0;
}

#endif
