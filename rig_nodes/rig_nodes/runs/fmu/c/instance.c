/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* The states of an instance and its variables, for both versions of FMI: which calls each state allows and refuses. */
#include "model.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int instance_refuse(instance *i, int status, const char *form, ...) {
  char sentence[MODEL_TEXT];
  va_list rest;
  va_start(rest, form);
  vsnprintf(sentence, sizeof sentence, form, rest);
  va_end(rest);
  i->say(i->importer, status, sentence);
  return status;
}

int instance_after(instance *i, int status) {
  if (status == MODEL_FATAL) i->phase = DEAD;
  if (status == MODEL_ERROR) i->phase = FAILED;
  return status;
}

/* Resets the instance to its start values, a start at 0 s and no stop time. */
static void starts(instance *i) {
  memset(&i->values, 0, sizeof i->values);
  memcpy(i->values.number, MODEL_STARTS, sizeof i->values.number);
  i->start = 0.0;
  i->stop = INFINITY;
  i->fresh = 0;
  i->phase = INSTANTIATED;
}

instance *instance_new(const char *token, const char *resources, model_say say, void *importer) {
  instance *i;
  if (!token || strcmp(token, MODEL_TOKEN) != 0) {
    say(importer, MODEL_ERROR, "the GUID or instantiation token is not that of this FMU's modelDescription.xml");
    return NULL;
  }
  i = calloc(1, sizeof *i);
  if (!i) return NULL;
  i->say = say;
  i->importer = importer;
  starts(i);
  i->model = model_new(resources, &i->values, say, importer);
  if (!i->model) {
    free(i);
    return NULL;
  }
  return i;
}

/* Computes the outputs of time 0 again when parameters or inputs have changed since. */
static int refresh(instance *i) {
  int status;
  if (i->fresh) return MODEL_OK;
  status = model_initialize(i->model);
  if (status == MODEL_OK) i->fresh = 1;
  return instance_after(i, status);
}

int instance_get(instance *i, char type, unsigned reference, double *value, const char **text) {
  if (i->phase == DEAD) return MODEL_FATAL;
  if (reference >= MODEL_COUNT || MODEL_TYPES[reference] != type)
    return instance_refuse(i, MODEL_ERROR, "value reference %u is none of a variable of this type", reference);
  if (i->phase == INSTANTIATED && MODEL_KINDS[reference] == 'o')
    return instance_refuse(i, MODEL_ERROR, "%s is an output and has no value before the initialization", MODEL_NAMES[reference]);
  if (i->phase == INITIALIZING && MODEL_KINDS[reference] == 'o') {
    const int status = refresh(i);
    if (status > MODEL_WARNING) return status;
  }
  if (text) *text = i->values.text[(int)i->values.number[reference]];
  else *value = i->values.number[reference];
  return MODEL_OK;
}

int instance_set(instance *i, char type, unsigned reference, double value, const char *text) {
  if (i->phase == DEAD) return MODEL_FATAL;
  if (reference >= MODEL_COUNT || MODEL_TYPES[reference] != type)
    return instance_refuse(i, MODEL_ERROR, "value reference %u is none of a variable of this type", reference);
  if (MODEL_KINDS[reference] == 'o')
    return instance_refuse(i, MODEL_ERROR, "%s is an output and cannot be set", MODEL_NAMES[reference]);
  if (i->phase > STEPPING)
    return instance_refuse(i, MODEL_ERROR, "%s cannot be set any more; reset before another run", MODEL_NAMES[reference]);
  if (MODEL_KINDS[reference] == 'p' && i->phase != INSTANTIATED && i->phase != INITIALIZING)
    return instance_refuse(i, MODEL_ERROR, "%s is a parameter and cannot be set after the initialization", MODEL_NAMES[reference]);
  if (type == 's') {
    if (!text) return instance_refuse(i, MODEL_ERROR, "%s takes a string", MODEL_NAMES[reference]);
    if (strlen(text) >= MODEL_TEXT)
      return instance_refuse(i, MODEL_ERROR, "%s takes at most %d characters", MODEL_NAMES[reference], MODEL_TEXT - 1);
    strcpy(i->values.text[(int)i->values.number[reference]], text);
  } else {
    i->values.number[reference] = value;
  }
  i->fresh = 0;
  return MODEL_OK;
}

int instance_set_up(instance *i, double start, double stop) {
  if (i->phase == DEAD) return MODEL_FATAL;
  if (i->phase != INSTANTIATED)
    return instance_refuse(i, MODEL_ERROR, "start and stop time are set before the initialization; reset before another run");
  if (!isfinite(start)) return instance_refuse(i, MODEL_ERROR, "a start time of %g s is refused; expected a finite one", start);
  if (!(stop >= start))
    return instance_refuse(i, MODEL_ERROR, "the stop time of %g s lies before the start time of %g s", stop, start);
  i->start = start;
  i->stop = stop;
  return MODEL_OK;
}

int instance_enter(instance *i) {
  if (i->phase == DEAD) return MODEL_FATAL;
  if (i->phase != INSTANTIATED)
    return instance_refuse(i, MODEL_ERROR, "the initialization comes first, and once; reset before another run");
  i->sample = 0;
  i->phase = INITIALIZING;
  return MODEL_OK;
}

int instance_leave_initialization(instance *i) {
  int status;
  if (i->phase == DEAD) return MODEL_FATAL;
  if (i->phase != INITIALIZING) return instance_refuse(i, MODEL_ERROR, "the initialization was not entered");
  status = refresh(i);
  if (status <= MODEL_WARNING) i->phase = STEPPING;
  return status;
}

double instance_time(const instance *i) { return i->start + (double)i->sample * MODEL_SAMPLE; }

int instance_step(instance *i, double time, double step) {
  const double samples = step / MODEL_SAMPLE;
  unsigned done = 0;
  int status;
  if (i->phase == DEAD) return MODEL_FATAL;
  if (i->phase == STOPPED)
    return instance_refuse(i, MODEL_ERROR, "the simulation has ended at %.6f s; terminate the instance, or reset it", instance_time(i));
  if (i->phase != STEPPING) return instance_refuse(i, MODEL_ERROR, "a step is for an initialized instance without an error");
  if (!(fabs(time - instance_time(i)) < 0.5 * MODEL_SAMPLE))
    return instance_refuse(i, MODEL_ERROR, "a step from %.6f s is asked for, but the instance stands at %.6f s", time, instance_time(i));
  if (!(samples > 0.5 && samples < 1e9 && fabs(samples - rint(samples)) < 1e-6 * (1.0 + fabs(samples))))
    return instance_refuse(i, MODEL_ERROR, "a communication step of %.9g s is refused; expected whole milliseconds", step);
  if (instance_time(i) + rint(samples) * MODEL_SAMPLE > i->stop + 1e-3 * MODEL_SAMPLE)
    return instance_refuse(i, MODEL_ERROR, "a step from %.6f s to %.6f s is asked for, past the stop time of %.6f s", instance_time(i),
                  instance_time(i) + step, i->stop);
  status = instance_after(i, model_step(i->model, i->sample, (unsigned)rint(samples), &done));
  i->sample += done;
  if (status == MODEL_DISCARD) i->phase = STOPPED;
  return status;
}

int instance_terminate(instance *i) {
  if (i->phase == DEAD) return MODEL_FATAL;
  if (i->phase < STEPPING || i->phase == TERMINATED)
    return instance_refuse(i, MODEL_ERROR, "there is no run that could be terminated");
  i->phase = TERMINATED;
  return instance_after(i, model_terminate(i->model));
}

int instance_reset(instance *i) {
  int status;
  if (i->phase == DEAD) return MODEL_FATAL;
  status = model_reset(i->model);
  starts(i);
  return instance_after(i, status);
}

void instance_free(instance *i) {
  if (!i) return;
  model_free(i->model);
  free(i);
}
