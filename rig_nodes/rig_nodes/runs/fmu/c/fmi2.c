/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* The functions of FMI 2.0 co-simulation over an instance (model.h). */
#include "fmi2Functions.h"
#include "model.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
  instance *inner;
  fmi2CallbackLogger logger;
  fmi2ComponentEnvironment environment;
  char *name;
} component;

static void say(void *importer, int status, const char *sentence) {
  component *c = importer;
  if (c->logger) c->logger(c->environment, c->name, (fmi2Status)status, MODEL_CATEGORIES[status], "%s", sentence);
}

/* Writes the path of a file: URI, with %XX decoded and without a slash at its end. */
static char *path_of(const char *uri) {
  const char *from = uri ? uri : "";
  char *path, *to;
  if (strncmp(from, "file://", 7) == 0) {
    from += 7;
    if (strncmp(from, "localhost", 9) == 0) from += 9;
  } else if (strncmp(from, "file:", 5) == 0) {
    from += 5;
  }
  path = to = malloc(strlen(from) + 1);
  if (!path) return NULL;
  while (*from) {
    char digits[3] = {0};
    if (from[0] == '%' && from[1] && from[2]) {
      memcpy(digits, from + 1, 2);
      *to++ = (char)strtol(digits, NULL, 16);
      from += 3;
    } else {
      *to++ = *from++;
    }
  }
  while (to > path + 1 && to[-1] == '/') to--;
  *to = 0;
  return path;
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

void fmi2FreeInstance(fmi2Component it) {
  component *c = it;
  if (!c) return;
  instance_free(c->inner);
  free(c->name);
  free(c);
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
  component *c = calloc(1, sizeof *c);
  char *path = path_of(resources);
  (void)visible;
  (void)logging;
  if (c && path && (c->name = malloc(strlen(name ? name : "") + 1))) {
    strcpy(c->name, name ? name : "");
    c->logger = functions ? functions->logger : NULL;
    c->environment = functions ? functions->componentEnvironment : NULL;
    if (type == fmi2CoSimulation) c->inner = instance_new(guid, path, say, c);
    else say(c, MODEL_ERROR, "this FMU is for co-simulation");
  }
  free(path);
  if (c && c->inner) return c;
  fmi2FreeInstance(c);
  return NULL;
}

fmi2Status fmi2SetupExperiment(fmi2Component it, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean has_stop, fmi2Real stop) {
  component *c = it;
  (void)has_tolerance;
  (void)tolerance;
  return (fmi2Status)instance_set_up(c->inner, start, has_stop ? stop : INFINITY);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component it) {
  return (fmi2Status)instance_enter(((component *)it)->inner);
}

fmi2Status fmi2ExitInitializationMode(fmi2Component it) {
  return (fmi2Status)instance_leave_initialization(((component *)it)->inner);
}

fmi2Status fmi2Terminate(fmi2Component it) { return (fmi2Status)instance_terminate(((component *)it)->inner); }
fmi2Status fmi2Reset(fmi2Component it) { return (fmi2Status)instance_reset(((component *)it)->inner); }

fmi2Status fmi2DoStep(fmi2Component it, fmi2Real time, fmi2Real step, fmi2Boolean no_way_back) {
  (void)no_way_back;
  return (fmi2Status)instance_step(((component *)it)->inner, time, step);
}

#define ACCESS(Name, Type, letter)                                                                              \
  fmi2Status fmi2Get##Name(fmi2Component it, const fmi2ValueReference r[], size_t n, fmi2##Name v[]) {          \
    for (size_t k = 0; k < n; k++) {                                                                            \
      double value = 0.0;                                                                                       \
      const int status = instance_get(((component *)it)->inner, letter, r[k], &value, NULL);                    \
      if (status > MODEL_WARNING) return (fmi2Status)status;                                                    \
      v[k] = (Type)value;                                                                                       \
    }                                                                                                           \
    return fmi2OK;                                                                                              \
  }                                                                                                             \
  fmi2Status fmi2Set##Name(fmi2Component it, const fmi2ValueReference r[], size_t n, const fmi2##Name v[]) {    \
    for (size_t k = 0; k < n; k++) {                                                                            \
      const int status = instance_set(((component *)it)->inner, letter, r[k], (double)v[k], NULL);              \
      if (status > MODEL_WARNING) return (fmi2Status)status;                                                    \
    }                                                                                                           \
    return fmi2OK;                                                                                              \
  }

ACCESS(Real, double, 'r')
ACCESS(Integer, int, 'i')
ACCESS(Boolean, int, 'b')

fmi2Status fmi2GetString(fmi2Component it, const fmi2ValueReference r[], size_t n, fmi2String v[]) {
  for (size_t k = 0; k < n; k++) {
    const int status = instance_get(((component *)it)->inner, 's', r[k], NULL, &v[k]);
    if (status > MODEL_WARNING) return (fmi2Status)status;
  }
  return fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component it, const fmi2ValueReference r[], size_t n, const fmi2String v[]) {
  for (size_t k = 0; k < n; k++) {
    const int status = instance_set(((component *)it)->inner, 's', r[k], 0.0, v[k]);
    if (status > MODEL_WARNING) return (fmi2Status)status;
  }
  return fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component it, fmi2FMUstate *state) {
  return (fmi2Status)instance_save(((component *)it)->inner, (instance_state **)state);
}
fmi2Status fmi2SetFMUstate(fmi2Component it, fmi2FMUstate state) {
  return (fmi2Status)instance_restore(((component *)it)->inner, state);
}
fmi2Status fmi2FreeFMUstate(fmi2Component it, fmi2FMUstate *state) {
  (void)it;
  if (!state) return fmi2OK;
  free(*state);
  *state = NULL;
  return fmi2OK;
}
fmi2Status fmi2SerializedFMUstateSize(fmi2Component it, fmi2FMUstate state, size_t *size) {
  return (fmi2Status)instance_state_size(((component *)it)->inner, state, size);
}
fmi2Status fmi2SerializeFMUstate(fmi2Component it, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
  return (fmi2Status)instance_serialize(((component *)it)->inner, state, (unsigned char *)bytes, size);
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component it, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
  return (fmi2Status)instance_deserialize(((component *)it)->inner, (const unsigned char *)bytes, size, (instance_state **)state);
}

/* ---- optional functions that modelDescription.xml does not offer; their parameters are not used */
#pragma GCC diagnostic ignored "-Wunused-parameter"

fmi2Status fmi2SetDebugLogging(fmi2Component it, fmi2Boolean on, size_t n, const fmi2String categories[]) { return fmi2OK; }

static fmi2Status not_offered(fmi2Component it, const char *sentence) {
  if (it) say(it, MODEL_ERROR, sentence);
  return fmi2Error;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component it, const fmi2ValueReference u[], size_t nu,
                                        const fmi2ValueReference k[], size_t nk, const fmi2Real dk[], fmi2Real du[]) {
  return not_offered(it, "this FMU has no directional derivatives");
}
fmi2Status fmi2SetRealInputDerivatives(fmi2Component it, const fmi2ValueReference r[], size_t n, const fmi2Integer order[],
                                       const fmi2Real value[]) {
  return not_offered(it, "this FMU holds its inputs for a step");
}
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component it, const fmi2ValueReference r[], size_t n, const fmi2Integer order[],
                                        fmi2Real value[]) {
  return not_offered(it, "this FMU has no output derivatives");
}
fmi2Status fmi2CancelStep(fmi2Component it) { return not_offered(it, "no step is ever pending here"); }
fmi2Status fmi2GetStatus(fmi2Component it, const fmi2StatusKind kind, fmi2Status *value) { return fmi2Discard; }
fmi2Status fmi2GetRealStatus(fmi2Component it, const fmi2StatusKind kind, fmi2Real *value) {
  if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
  *value = instance_time(((component *)it)->inner);
  return fmi2OK;
}
fmi2Status fmi2GetIntegerStatus(fmi2Component it, const fmi2StatusKind kind, fmi2Integer *value) { return fmi2Discard; }
fmi2Status fmi2GetBooleanStatus(fmi2Component it, const fmi2StatusKind kind, fmi2Boolean *value) {
  if (kind != fmi2Terminated) return fmi2Discard;
  *value = ((component *)it)->inner->phase == STOPPED;
  return fmi2OK;
}
fmi2Status fmi2GetStringStatus(fmi2Component it, const fmi2StatusKind kind, fmi2String *value) { return fmi2Discard; }
