/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* The Alfa46 law as a user's controller in C99: profiles P1-P6, delays t12 to t32, PID on the coil current.
 *
 *   cc -std=c99 -O2 -ffp-contract=off -fPIC -shared -I<this rig's include folder> -o alfa46.so alfa46.c -lm
 *   ./rig simulate demo --controller c:alfa46.so
 *
 * Built with these options it gives the same bits as the built-in controller, at both levels.
 */
#include "rig_controller.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { OFF, ON, FALLING };
enum { OUTPUTS = 3, POINTS = 6 }; /* the box has three outputs at most */

typedef struct {
  double time[POINTS], current[POINTS]; /* P1-P6 [s], [A] */
  int phase, pending;
  double start, pending_at;             /* samples of the switch signals */
  double from_current, setpoint;        /* [A] */
  double integral, filtered, duty;
} output_t;

typedef struct {
  double period, t12, t21, t23, t32, supply_voltage, gain_p, gain_i, gain_d, derivative_time;
  output_t outputs[OUTPUTS];
  uint32_t count, level, gear;          /* count: outputs of the rig */
  double shift_end;                     /* sample */
} alfa46_t;

static double at_least(double value, double low) { return low > value ? low : value; }
static double at_most(double value, double high) { return high < value ? high : value; }

/* Reads a parameter; returns 0 and writes a message when the rig does not have it. */
static int read_parameter(rig_controller_info *info, const char *name, double *value) {
  for (uint32_t k = 0; k < info->parameter_count; k++) {
    if (strcmp(info->parameters[k].name, name) == 0) {
      *value = info->parameters[k].value;
      return 1;
    }
  }
  snprintf(info->message, sizeof info->message, "parameter %s is not given", name);
  return 0;
}

static int read_output(rig_controller_info *info, int number, output_t *output) {
  char name[64];
  for (int n = 0; n < POINTS; n++) {
    snprintf(name, sizeof name, "output_%d.P%d.time", number, n + 1);
    if (!read_parameter(info, name, &output->time[n])) return 0;
    snprintf(name, sizeof name, "output_%d.P%d.current", number, n + 1);
    if (!read_parameter(info, name, &output->current[n])) return 0;
  }
  return 1;
}

static void switch_output(alfa46_t *box, uint32_t number, int phase, double at, int last_point) {
  output_t *output = &box->outputs[number - 1];
  output->pending = phase;
  output->pending_at = at;
  box->shift_end = at_least(box->shift_end, at + rint(output->time[last_point] / box->period));
}

/* Switches the valves of the old and the new gear, one of them later by the delay of this change. */
static void order_gear(alfa46_t *box, uint32_t gear, double sample) {
  double delay = 0.0, wait;
  if (box->gear == 1 && gear == 2) delay = box->t12;
  if (box->gear == 2 && gear == 1) delay = box->t21;
  if (box->gear == 2 && gear == 3) delay = box->t23;
  if (box->gear == 3 && gear == 2) delay = box->t32;
  wait = rint(delay / box->period);
  box->shift_end = sample;
  if (gear) switch_output(box, gear, ON, sample + at_least(0.0, wait), 2);
  if (box->gear) switch_output(box, box->gear, FALLING, sample + at_least(0.0, -wait), 5);
  box->gear = gear;
}

/* The setpoint follows straight lines: through P1-P3 after switch-on, through P4-P6 after switch-off. */
static void follow_profile(output_t *output, double sample, double period) {
  if (output->pending != OFF && sample >= output->pending_at) {
    output->phase = output->pending;
    output->start = output->pending_at;
    output->from_current = output->setpoint;
    output->pending = OFF;
  }
  if (output->phase == OFF) {
    output->setpoint = 0.0;
    return;
  }
  const int first = output->phase == ON ? 0 : 3;
  const double elapsed = (sample - output->start) * period;
  double t0 = 0.0, i0 = output->phase == ON ? 0.0 : output->from_current;
  for (int n = first; n < first + 3; n++) {
    const double t1 = output->time[n], i1 = output->current[n];
    if (elapsed < t1) {
      i0 = i0 + (i1 - i0) * (elapsed - t0) / (t1 - t0);
      break;
    }
    t0 = t1;
    i0 = i1;
  }
  output->setpoint = i0;
  if (output->phase == FALLING && elapsed > output->time[5] && output->setpoint <= 0.0) {
    output->phase = OFF;
    output->setpoint = 0.0;
  }
}

/* PID with an output in volts; the derivative is filtered, and the integral is limited to the supply voltage. */
static void close_loop(output_t *output, double current, const alfa46_t *box) {
  if (output->phase == OFF) {
    output->duty = 0.0;
    output->integral = 0.0;
    output->filtered = -current;
    return;
  }
  const double error = output->setpoint - current;
  const double slope = (error - output->filtered) / box->derivative_time;
  output->filtered += slope * box->period;
  output->integral =
      at_most(at_least(output->integral + box->gain_i * error * box->period, 0.0), box->supply_voltage);
  const double voltage = box->gain_p * error + output->integral + box->gain_d * slope;
  output->duty = at_most(at_least(voltage / box->supply_voltage, 0.0), 1.0);
}

const rig_controller_abi_info *rig_controller_abi(void) {
  RIG_CONTROLLER_DESCRIBE(RIG_LEVEL_DUTY | RIG_LEVEL_CURRENT);
}

int rig_controller_create(rig_controller_info *info, void **instance) {
  alfa46_t *box;
  if (info->size != sizeof *info) return RIG_ERROR;
  if (info->output_count > OUTPUTS) {
    snprintf(info->message, sizeof info->message, "the rig has %u outputs, this box three", (unsigned)info->output_count);
    return RIG_ERROR;
  }
  box = calloc(1, sizeof *box);
  if (!box) return RIG_ERROR;
  box->period = info->period;
  box->level = info->level;
  box->count = info->output_count;
  int found = read_parameter(info, "t12", &box->t12) && read_parameter(info, "t21", &box->t21) &&
              read_parameter(info, "t23", &box->t23) && read_parameter(info, "t32", &box->t32) &&
              read_parameter(info, "supply_voltage", &box->supply_voltage) &&
              read_parameter(info, "gain_p", &box->gain_p) && read_parameter(info, "gain_i", &box->gain_i) &&
              read_parameter(info, "gain_d", &box->gain_d) &&
              read_parameter(info, "derivative_time", &box->derivative_time);
  for (uint32_t k = 0; k < box->count && found; k++) found = read_output(info, (int)k + 1, &box->outputs[k]);
  if (!found) {
    free(box);
    return RIG_ERROR;
  }
  *instance = box;
  return RIG_OK;
}

int rig_controller_step(void *instance, const rig_controller_inputs *inputs, rig_controller_outputs *outputs) {
  alfa46_t *box = instance;
  const double sample = (double)inputs->sample;
  if (inputs->size != sizeof *inputs || outputs->size != sizeof *outputs) return RIG_FATAL;
  if (inputs->gear_request > box->count) {
    snprintf(outputs->message, sizeof outputs->message, "there is no gear %u", (unsigned)inputs->gear_request);
    return RIG_ERROR;
  }
  if (inputs->gear_request != box->gear && sample >= box->shift_end) order_gear(box, inputs->gear_request, sample);
  for (uint32_t k = 0; k < box->count; k++) {
    output_t *output = &box->outputs[k];
    follow_profile(output, sample, box->period);
    close_loop(output, inputs->current[k], box);
    outputs->setpoint[k] = output->setpoint;
    outputs->command[k] = box->level == RIG_LEVEL_CURRENT ? output->setpoint : output->duty;
    if (output->phase != OFF) outputs->flags |= 1u << k;
  }
  outputs->gear = box->gear;
  outputs->shifting = sample < box->shift_end;
  return RIG_OK;
}

void rig_controller_destroy(void *instance) { free(instance); }

uint32_t rig_controller_save(void *instance, void *bytes) {
  if (bytes) memcpy(bytes, instance, sizeof(alfa46_t));
  return sizeof(alfa46_t);
}

int rig_controller_load(void *instance, const void *bytes, uint32_t size) {
  if (size != sizeof(alfa46_t)) return RIG_ERROR;
  memcpy(instance, bytes, size);
  return RIG_OK;
}
