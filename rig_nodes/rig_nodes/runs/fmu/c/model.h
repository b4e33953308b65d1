/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* The interface that the functions of FMI 2.0 (fmi2.c) and FMI 3.0 (fmi3.c) call: one model with its values and functions.
 *
 * An FMU is one of those two files with one model: the rig as a process (rig_process.c) or a shift controller of
 * rig_controller.h (controller_model.c). variables.h is written when the FMU is built; it lists the variables.
 */
#ifndef MODEL_H
#define MODEL_H

#include <stddef.h>

#include "variables.h" /* MODEL_TOKEN, MODEL_COUNT, MODEL_TEXTS, MODEL_TYPES, MODEL_KINDS, MODEL_STARTS, MODEL_NAMES */

#define MODEL_TEXT 1024 /* bytes of a string variable or message, including the terminating zero */
#define MODEL_SAMPLE 1e-3 /* s; a communication step is a whole multiple of it */

/* Numbers of fmi2Status and fmi3Status. */
enum { MODEL_OK, MODEL_WARNING, MODEL_DISCARD, MODEL_ERROR, MODEL_FATAL };

/* Names of log categories, by status. */
static const char *const MODEL_CATEGORIES[] = {"logEvents", "logStatusWarning", "logStatusDiscard", "logStatusError",
                                               "logStatusFatal"};

/* number[r]: value of the real, integer or boolean r; for a string r, the number of its text. */
typedef struct {
  double number[MODEL_COUNT];
  char text[MODEL_TEXTS][MODEL_TEXT];
} model_values;

typedef struct model model;

/* Reports one sentence to the importer. */
typedef void (*model_say)(void *importer, int status, const char *sentence);

/* Returns a new model that reads and writes `values`, or reports a sentence and returns NULL.
 * resources: the path of the FMU's folder "resources", without a slash at its end. */
model *model_new(const char *resources, model_values *values, model_say say, void *importer);

/* Reads parameters and inputs and writes the outputs of time 0; it may be called again until the first step. */
int model_initialize(model *m);

/* Computes `samples` of MODEL_SAMPLE with constant inputs; `sample` is the number of samples computed before. When the model
 * ends the simulation, it reports a sentence and returns MODEL_DISCARD, with the samples computed until then in *done. */
int model_step(model *m, unsigned long sample, unsigned samples, unsigned *done);

/* Ends the run; a new one begins with model_initialize. */
int model_terminate(model *m);

/* Resets the model to its state after model_new. */
int model_reset(model *m);

/* Stores a copy of the model's state in *bytes, which the caller frees; NULL and a size of 0 when there is none yet. */
int model_save(model *m, unsigned char **bytes, size_t *size);

/* Brings back a state that model_save stored, here or in another instance; the values are already those of that moment. */
int model_restore(model *m, const unsigned char *bytes, size_t size);

void model_free(model *m);

/* ---- common functions for fmi2.c and fmi3.c (instance.c) */

/* STOPPED: the model has ended the simulation by itself. */
typedef enum { INSTANTIATED, INITIALIZING, STEPPING, STOPPED, TERMINATED, FAILED, DEAD } model_phase;

typedef struct {
  model_values values;
  model *model;
  model_phase phase;
  model_say say;
  void *importer;
  int fresh;            /* the outputs were computed with the present parameters */
  double start, stop;   /* time of the first step and the time that no step may pass [s] */
  unsigned long sample; /* samples since the start */
} instance;

instance *instance_new(const char *token, const char *resources, model_say say, void *importer);
int instance_get(instance *i, char type, unsigned reference, double *value, const char **text);
int instance_set(instance *i, char type, unsigned reference, double value, const char *text);
int instance_set_up(instance *i, double start, double stop);
int instance_enter(instance *i);
int instance_leave_initialization(instance *i);
int instance_step(instance *i, double time, double step); /* MODEL_DISCARD: the step ended early, at instance_time() */
int instance_terminate(instance *i);
int instance_reset(instance *i);
void instance_free(instance *i);
double instance_time(const instance *i);
int instance_refuse(instance *i, int status, const char *form, ...); /* reports a sentence and returns the status */
int instance_after(instance *i, int status); /* sets the phase from the status of a call of the model, and returns the status */

/* ---- the state of an instance, saved and brought back (state.c); it holds no pointer, so its bytes serve any instance */

typedef struct instance_state instance_state;

int instance_save(instance *i, instance_state **state); /* replaces *state when that is not NULL */
int instance_restore(instance *i, const instance_state *state);
int instance_state_size(instance *i, const instance_state *state, size_t *size);
int instance_serialize(instance *i, const instance_state *state, unsigned char *bytes, size_t size);
int instance_deserialize(instance *i, const unsigned char *bytes, size_t size, instance_state **state);

#endif
