/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* Calls an FMU's functions as an importer does, in right and in wrong orders, in two rounds; test_sanitized.py builds it with
 * sanitizers. Its argument is the URI of the folder of resources. It prints the sentence of each refusal.
 */
#include "fmi2Functions.h"
#include "model.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void log_message(void *environment, fmi2String name, fmi2Status status, fmi2String category, fmi2String form, ...) {
  va_list rest;
  (void)environment;
  (void)category;
  va_start(rest, form);
  printf("%s %d: ", name, (int)status);
  vprintf(form, rest);
  printf("\n");
  va_end(rest);
}

static void check(int good, const char *what) {
  if (good) return;
  printf("FAILED: %s\n", what);
  exit(1);
}

/* Saves the state of one instance, brings it back there and in the other one, and offers bytes that are no state. */
static void check_states(fmi2Component one, fmi2Component other, double time) {
  fmi2FMUstate state = NULL, read = NULL, again = NULL;
  size_t size = 0;
  check(fmi2SetFMUstate(one, NULL) == fmi2Error && fmi2GetFMUstate(one, NULL) == fmi2Error, "no state and no place for one");
  check(fmi2FreeFMUstate(one, NULL) == fmi2OK && fmi2FreeFMUstate(one, &state) == fmi2OK, "nothing to free");
  check(fmi2GetFMUstate(one, &state) == fmi2OK && fmi2GetFMUstate(one, &state) == fmi2OK, "a state, and again in its place");
  check(fmi2SerializedFMUstateSize(one, state, &size) == fmi2OK, "its size");
  fmi2Byte *bytes = malloc(size), *more = malloc(size);
  check(fmi2SerializeFMUstate(one, state, bytes, size - 1) == fmi2Error, "too few bytes");
  check(fmi2SerializeFMUstate(one, state, bytes, size) == fmi2OK, "its bytes");
  for (size_t cut = 0; cut < size; cut += 1 + cut / 3) {
    memcpy(more, bytes, size);
    check(fmi2DeSerializeFMUstate(one, more, cut, &read) == fmi2Error, "cut bytes");
    more[cut] = (fmi2Byte)(more[cut] ^ 8);
    check(fmi2DeSerializeFMUstate(one, more, size, &read) == fmi2Error && !read, "changed bytes");
  }
  for (int round = 0; round < 3; round++) {
    check(fmi2DoStep(one, time, 0.002, 0) == fmi2OK && fmi2SetFMUstate(one, state) == fmi2OK, "back again");
    check(fmi2DeSerializeFMUstate(other, bytes, size, &read) == fmi2OK && fmi2SetFMUstate(other, read) == fmi2OK, "from bytes");
    check(fmi2DoStep(other, time, 0.002, 0) == fmi2OK && fmi2SetFMUstate(other, state) == fmi2OK, "of another instance");
  }
  check(fmi2GetFMUstate(other, &again) == fmi2OK && fmi2SerializeFMUstate(other, again, more, size) == fmi2OK, "as it was");
  check(memcmp(bytes, more, size) == 0, "equal bytes of an equal state");
  check(fmi2FreeFMUstate(one, &state) == fmi2OK && fmi2FreeFMUstate(one, &read) == fmi2OK && !state && !read, "freed");
  check(fmi2FreeFMUstate(other, &again) == fmi2OK && fmi2Reset(other) == fmi2OK, "freed");
  free(bytes);
  free(more);
}

int main(int count, char **arguments) {
  const fmi2CallbackFunctions callbacks = {log_message, calloc, free, NULL, NULL};
  check(count == 2, "one argument");
  check(!fmi2Instantiate("wrong", fmi2CoSimulation, "{0}", arguments[1], &callbacks, 0, 0), "a wrong GUID is refused");
  check(!fmi2Instantiate("wrong", fmi2ModelExchange, MODEL_TOKEN, arguments[1], &callbacks, 0, 0), "model exchange is refused");
  fmi2Component one = fmi2Instantiate("one", fmi2CoSimulation, MODEL_TOKEN, arguments[1], &callbacks, 0, 1);
  fmi2Component other = fmi2Instantiate("other", fmi2CoSimulation, MODEL_TOKEN, arguments[1], &callbacks, 0, 1);
  check(one && other, "two instances");
  for (int round = 0; round < 2; round++) {
    check(fmi2DoStep(one, 0.0, 0.001, 1) == fmi2Error, "a step before the initialization");
    check(fmi2Terminate(one) == fmi2Error, "no run to terminate");
    for (fmi2ValueReference r = 0; r < MODEL_COUNT; r++) {
      fmi2Real real;
      if (MODEL_TYPES[r] != 'r') continue;
      check(fmi2GetReal(one, &r, 1, &real) == (MODEL_KINDS[r] == 'o' ? fmi2Error : fmi2OK), "start values, no outputs");
    }
    check(fmi2SetupExperiment(one, 0, 0.0, 1.0, 1, 0.5) == fmi2Error, "an end before the start");
    check(fmi2SetupExperiment(one, 0, 0.0, NAN, 0, 0.0) == fmi2Error, "a start that is no number");
    check(fmi2SetupExperiment(one, 0, 0.0, 1.0, 1, 1.1) == fmi2OK, "set up");
    check(fmi2EnterInitializationMode(one) == fmi2OK && fmi2ExitInitializationMode(one) == fmi2OK, "initialization");
    check(fmi2EnterInitializationMode(one) == fmi2Error, "a second initialization");
    for (int step = 0; step < 50; step++) {
      check(fmi2DoStep(one, 1.0 + 0.002 * step, 0.002, 1) == fmi2OK, "step");
      for (fmi2ValueReference r = 0; r < MODEL_COUNT; r++) {
        fmi2Real real;
        fmi2Integer whole;
        fmi2String text;
        if (MODEL_TYPES[r] == 'r') check(fmi2GetReal(one, &r, 1, &real) == fmi2OK && isfinite(real), "a real");
        if (MODEL_TYPES[r] == 'i') check(fmi2GetInteger(one, &r, 1, &whole) == fmi2OK, "an integer");
        if (MODEL_TYPES[r] == 'b') check(fmi2GetBoolean(one, &r, 1, &whole) == fmi2OK && (whole == 0 || whole == 1), "a boolean");
        if (MODEL_TYPES[r] == 's') check(fmi2GetString(one, &r, 1, &text) == fmi2OK && strlen(text) < MODEL_TEXT, "a string");
        if (MODEL_TYPES[r] != 'r') check(fmi2GetReal(one, &r, 1, &real) == fmi2Error, "a wrong type");
      }
    }
    fmi2Reset(one);
    check(fmi2SetupExperiment(one, 0, 0.0, 1.0, 1, 1.1) == fmi2OK, "set up");
    check(fmi2EnterInitializationMode(one) == fmi2OK && fmi2ExitInitializationMode(one) == fmi2OK, "initialization");
    check(fmi2DoStep(one, 1.0, 0.098, 1) == fmi2OK, "step");
    check_states(one, other, 1.098);
    check(fmi2DoStep(one, 1.098, 0.002, 1) == fmi2OK, "step");
    check(fmi2DoStep(one, 7.0, 0.001, 1) == fmi2Error, "a step from elsewhere");
    check(fmi2DoStep(one, 1.1, NAN, 1) == fmi2Error, "a step that is no number");
    check(fmi2DoStep(one, 1.1, 0.001, 1) == fmi2Error, "a step past the stop time");
    check(fmi2SetupExperiment(one, 0, 0.0, 0.0, 0, 0.0) == fmi2Error, "no new start in a run");
    fmi2ValueReference nowhere = MODEL_COUNT;
    fmi2Real value = 0.0;
    check(fmi2SetReal(one, &nowhere, 1, &value) == fmi2Error, "a variable that is none");
    check(fmi2Terminate(one) == fmi2OK && fmi2Terminate(one) == fmi2Error, "terminate, once");
    check(fmi2DoStep(one, 1.1, 0.001, 1) == fmi2Error, "a step after the end");
    check(fmi2Reset(one) == fmi2OK, "reset");
  }
  char *lengthy = malloc(3000);
  memset(lengthy, 'x', 2999);
  lengthy[2999] = 0;
  for (fmi2ValueReference r = 0; r < MODEL_COUNT; r++)
    if (MODEL_TYPES[r] == 's' && MODEL_KINDS[r] == 'p')
      check(fmi2SetString(one, &r, 1, (const fmi2String[]){lengthy}) == fmi2Error
            && fmi2SetString(one, &r, 1, (const fmi2String[]){NULL}) == fmi2Error, "a string that is too long, and none");
  free(lengthy);
  fmi2FreeInstance(one);
  fmi2FreeInstance(other);
  fmi2FreeInstance(NULL);
  puts("done");
  return 0;
}
