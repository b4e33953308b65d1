/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* The functions of FMI 3.0 co-simulation over an instance (model.h). */
#include "fmi3Functions.h"
#include "model.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { TIME = MODEL_COUNT }; /* value reference of the independent variable */

typedef struct {
  instance *inner;
  fmi3LogMessageCallback log;
  fmi3InstanceEnvironment environment;
  int early; /* the importer accepts a step that ends early */
} component;

static void say(void *importer, int status, const char *sentence) {
  component *c = importer;
  /* in FMI 3.0 a model that ends the simulation has not discarded its step */
  if (status == MODEL_DISCARD) status = MODEL_WARNING;
  if (c->log) c->log(c->environment, (fmi3Status)status, MODEL_CATEGORIES[status], sentence);
}

static instance *in(fmi3Instance it) { return ((component *)it)->inner; }

static fmi3Status other_count(fmi3Instance it) {
  say(it, MODEL_ERROR, "this FMU has no arrays: each value reference has one value");
  return fmi3Error;
}

const char *fmi3GetVersion(void) { return fmi3Version; }

void fmi3FreeInstance(fmi3Instance it) {
  component *c = it;
  if (!c) return;
  instance_free(c->inner);
  free(c);
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance it) { return (fmi3Status)instance_leave_initialization(in(it)); }
fmi3Status fmi3Terminate(fmi3Instance it) { return (fmi3Status)instance_terminate(in(it)); }
fmi3Status fmi3Reset(fmi3Instance it) { return (fmi3Status)instance_reset(in(it)); }

#define ACCESS(Name, letter)                                                                                    \
  fmi3Status fmi3Get##Name(fmi3Instance it, const fmi3ValueReference r[], size_t n, fmi3##Name v[], size_t nv) { \
    if (nv != n) return other_count(it);                                                                              \
    for (size_t k = 0; k < n; k++) {                                                                            \
      double value = instance_time(in(it));                                                                     \
      const int is_time = letter == 'r' && r[k] == TIME;                                                        \
      const int status = is_time ? MODEL_OK : instance_get(in(it), letter, r[k], &value, NULL);                 \
      if (status > MODEL_WARNING) return (fmi3Status)status;                                                    \
      v[k] = (fmi3##Name)value;                                                                                 \
    }                                                                                                           \
    return fmi3OK;                                                                                              \
  }                                                                                                             \
  fmi3Status fmi3Set##Name(fmi3Instance it, const fmi3ValueReference r[], size_t n, const fmi3##Name v[], size_t nv) { \
    if (nv != n) return other_count(it);                                                                              \
    for (size_t k = 0; k < n; k++) {                                                                            \
      const int status = instance_set(in(it), letter, r[k], (double)v[k], NULL);                                \
      if (status > MODEL_WARNING) return (fmi3Status)status;                                                    \
    }                                                                                                           \
    return fmi3OK;                                                                                              \
  }

ACCESS(Float64, 'r')
ACCESS(Int32, 'i')
ACCESS(Int64, 'e') /* enumerations */
ACCESS(Boolean, 'b')

fmi3Status fmi3GetString(fmi3Instance it, const fmi3ValueReference r[], size_t n, fmi3String v[], size_t nv) {
  if (nv != n) return other_count(it);
  for (size_t k = 0; k < n; k++) {
    const int status = instance_get(in(it), 's', r[k], NULL, &v[k]);
    if (status > MODEL_WARNING) return (fmi3Status)status;
  }
  return fmi3OK;
}

fmi3Status fmi3SetString(fmi3Instance it, const fmi3ValueReference r[], size_t n, const fmi3String v[], size_t nv) {
  if (nv != n) return other_count(it);
  for (size_t k = 0; k < n; k++) {
    const int status = instance_set(in(it), 's', r[k], 0.0, v[k]);
    if (status > MODEL_WARNING) return (fmi3Status)status;
  }
  return fmi3OK;
}

fmi3Status fmi3GetFMUState(fmi3Instance it, fmi3FMUState *state) {
  return (fmi3Status)instance_save(in(it), (instance_state **)state);
}
fmi3Status fmi3SetFMUState(fmi3Instance it, fmi3FMUState state) { return (fmi3Status)instance_restore(in(it), state); }
fmi3Status fmi3FreeFMUState(fmi3Instance it, fmi3FMUState *state) {
  (void)it;
  if (!state) return fmi3OK;
  free(*state);
  *state = NULL;
  return fmi3OK;
}
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance it, fmi3FMUState state, size_t *size) {
  return (fmi3Status)instance_state_size(in(it), state, size);
}
fmi3Status fmi3SerializeFMUState(fmi3Instance it, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
  return (fmi3Status)instance_serialize(in(it), state, bytes, size);
}
fmi3Status fmi3DeserializeFMUState(fmi3Instance it, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
  return (fmi3Status)instance_deserialize(in(it), bytes, size, (instance_state **)state);
}

/* ---- the functions below do not use parameters that have no meaning for these models */
#pragma GCC diagnostic ignored "-Wunused-parameter"

fmi3Status fmi3SetDebugLogging(fmi3Instance it, fmi3Boolean on, size_t n, const fmi3String categories[]) { return fmi3OK; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference required[], size_t n, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
  component *c = calloc(1, sizeof *c);
  char *path = malloc(strlen(resources ? resources : "") + 1);
  if (c && path) {
    size_t length;
    c->log = log;
    c->environment = environment;
    c->early = early;
    strcpy(path, resources ? resources : "");
    for (length = strlen(path); length > 1 && path[length - 1] == '/';) path[--length] = 0;
    c->inner = instance_new(token, path, say, c);
  }
  free(path);
  if (c && c->inner) return c;
  fmi3FreeInstance(c);
  return NULL;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance it, fmi3Boolean has_tolerance, fmi3Float64 tolerance, fmi3Float64 start,
                                       fmi3Boolean has_stop, fmi3Float64 stop) {
  const int status = instance_set_up(in(it), start, has_stop ? stop : INFINITY);
  return (fmi3Status)(status > MODEL_WARNING ? status : instance_enter(in(it)));
}

fmi3Status fmi3DoStep(fmi3Instance it, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_way_back, fmi3Boolean *event,
                      fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *last) {
  const int status = instance_step(in(it), time, step);
  *event = fmi3False;
  *last = instance_time(in(it));
  *end = status == MODEL_DISCARD;
  *early = *end && ((component *)it)->early && *last < time + step - 0.5 * MODEL_SAMPLE;
  return *end ? fmi3Warning : (fmi3Status)status;
}

/* ---- functions of capabilities that modelDescription.xml does not offer */

static fmi3Status not_offered(fmi3Instance it, const char *what) {
  if (it) say(it, MODEL_ERROR, what);
  return fmi3Error;
}
#define NO(what) { return not_offered(it, "this FMU has no " what); }
#define NONE_OF(Name)                                                                                           \
  fmi3Status fmi3Get##Name(fmi3Instance it, const fmi3ValueReference r[], size_t n, fmi3##Name v[], size_t nv) { \
    return n ? not_offered(it, "this FMU has no variables of type " #Name) : fmi3OK;                            \
  }                                                                                                             \
  fmi3Status fmi3Set##Name(fmi3Instance it, const fmi3ValueReference r[], size_t n, const fmi3##Name v[], size_t nv) { \
    return n ? not_offered(it, "this FMU has no variables of type " #Name) : fmi3OK;                            \
  }

NONE_OF(Float32)
NONE_OF(Int8)
NONE_OF(UInt8)
NONE_OF(Int16)
NONE_OF(UInt16)
NONE_OF(UInt32)
NONE_OF(UInt64)

typedef const fmi3ValueReference refs[];

static fmi3Instance co_simulation_only(fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
  if (log) log(environment, fmi3Error, MODEL_CATEGORIES[MODEL_ERROR], "this FMU is for co-simulation");
  return NULL;
}
fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
  return co_simulation_only(environment, log);
}
fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                               fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                               fmi3LogMessageCallback log, fmi3ClockUpdateCallback update,
                                               fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock) {
  return co_simulation_only(environment, log);
}
fmi3Status fmi3EnterEventMode(fmi3Instance it) NO("event mode")
fmi3Status fmi3GetBinary(fmi3Instance it, refs r, size_t n, size_t sizes[], fmi3Binary v[], size_t nv) NO("binary variables")
fmi3Status fmi3SetBinary(fmi3Instance it, refs r, size_t n, const size_t sizes[], const fmi3Binary v[], size_t nv) NO("binary variables")
fmi3Status fmi3GetClock(fmi3Instance it, refs r, size_t n, fmi3Clock v[]) NO("clocks")
fmi3Status fmi3SetClock(fmi3Instance it, refs r, size_t n, const fmi3Clock v[]) NO("clocks")
fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance it, fmi3ValueReference r, size_t *n) NO("variable dependencies")
fmi3Status fmi3GetVariableDependencies(fmi3Instance it, fmi3ValueReference d, size_t di[], fmi3ValueReference i[], size_t ii[],
                                       fmi3DependencyKind kinds[], size_t n) NO("variable dependencies")
fmi3Status fmi3GetDirectionalDerivative(fmi3Instance it, refs u, size_t nu, refs k, size_t nk, const fmi3Float64 seed[],
                                        size_t ns, fmi3Float64 out[], size_t no) NO("derivatives")
fmi3Status fmi3GetAdjointDerivative(fmi3Instance it, refs u, size_t nu, refs k, size_t nk, const fmi3Float64 seed[],
                                    size_t ns, fmi3Float64 out[], size_t no) NO("derivatives")
fmi3Status fmi3EnterConfigurationMode(fmi3Instance it) NO("configuration mode")
fmi3Status fmi3ExitConfigurationMode(fmi3Instance it) NO("configuration mode")
fmi3Status fmi3GetIntervalDecimal(fmi3Instance it, refs r, size_t n, fmi3Float64 v[], fmi3IntervalQualifier q[]) NO("clocks")
fmi3Status fmi3GetIntervalFraction(fmi3Instance it, refs r, size_t n, fmi3UInt64 c[], fmi3UInt64 s[], fmi3IntervalQualifier q[]) NO("clocks")
fmi3Status fmi3GetShiftDecimal(fmi3Instance it, refs r, size_t n, fmi3Float64 v[]) NO("clocks")
fmi3Status fmi3GetShiftFraction(fmi3Instance it, refs r, size_t n, fmi3UInt64 c[], fmi3UInt64 s[]) NO("clocks")
fmi3Status fmi3SetIntervalDecimal(fmi3Instance it, refs r, size_t n, const fmi3Float64 v[]) NO("clocks")
fmi3Status fmi3SetIntervalFraction(fmi3Instance it, refs r, size_t n, const fmi3UInt64 c[], const fmi3UInt64 s[]) NO("clocks")
fmi3Status fmi3SetShiftDecimal(fmi3Instance it, refs r, size_t n, const fmi3Float64 v[]) NO("clocks")
fmi3Status fmi3SetShiftFraction(fmi3Instance it, refs r, size_t n, const fmi3UInt64 c[], const fmi3UInt64 s[]) NO("clocks")
fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance it) NO("event mode")
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance it, fmi3Boolean *need, fmi3Boolean *end, fmi3Boolean *nominals,
                                    fmi3Boolean *values, fmi3Boolean *defined, fmi3Float64 *next) NO("event mode")
fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance it) NO("model exchange")
fmi3Status fmi3CompletedIntegratorStep(fmi3Instance it, fmi3Boolean no_way_back, fmi3Boolean *event, fmi3Boolean *end) NO("model exchange")
fmi3Status fmi3SetTime(fmi3Instance it, fmi3Float64 time) NO("model exchange")
fmi3Status fmi3SetContinuousStates(fmi3Instance it, const fmi3Float64 x[], size_t n) NO("model exchange")
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance it, fmi3Float64 dx[], size_t n) NO("model exchange")
fmi3Status fmi3GetEventIndicators(fmi3Instance it, fmi3Float64 z[], size_t n) NO("model exchange")
fmi3Status fmi3GetContinuousStates(fmi3Instance it, fmi3Float64 x[], size_t n) NO("model exchange")
fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance it, fmi3Float64 x[], size_t n) NO("model exchange")
fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance it, size_t *n) NO("model exchange")
fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance it, size_t *n) NO("model exchange")
fmi3Status fmi3EnterStepMode(fmi3Instance it) NO("event mode")
fmi3Status fmi3GetOutputDerivatives(fmi3Instance it, refs r, size_t n, const fmi3Int32 orders[], fmi3Float64 v[], size_t nv) NO("output derivatives")
fmi3Status fmi3ActivateModelPartition(fmi3Instance it, fmi3ValueReference r, fmi3Float64 time) NO("scheduled execution")
