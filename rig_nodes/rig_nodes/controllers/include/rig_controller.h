/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* Shift controllers for the virtual rig as C shared libraries, in C99, usable from C++. This file is the same for every rig.
 * rig_record.h, which `./rig controller new` and `./rig export record` write, has the names of one rig's outputs,
 * transducers and gears. A library that includes it states this (RIG_CONTROLLER_DESCRIBE) and runs only on such a rig.
 *
 * A library exports the four functions below. The rig calls them from one thread only: abi once, create once,
 * step once per controller sample in order, destroy once. All values are SI; speeds in rad/s, pressures in Pa
 * above ambient. The structs have the same layout with any compiler of the platform's standard C ABI; their sizes
 * are checked by the rig (rig_controller_abi) and can be checked by the library (member size).
 */
#ifndef RIG_CONTROLLER_H
#define RIG_CONTROLLER_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define RIG_CONTROLLER_ABI 2u     /* raised with each change of this file that breaks libraries compiled before; a new
                                   * optional function breaks none, because an older rig never calls it */
#define RIG_CONTROLLER_TEXT 128   /* bytes of a message, including the terminating zero */
#define RIG_CONTROLLER_RECORD NULL /* NULL: runs on any rig, by the names in rig_controller_info; rig_record.h replaces it */

/* What a command means. A library that can work at both levels names both, joined by |. */
#define RIG_LEVEL_DUTY 1u         /* command: duty of the coil, 0 to 1; the controller closes the current loop */
#define RIG_LEVEL_CURRENT 2u      /* command: current setpoint [A]; the rig's power stage closes the loop */

/* Status that a function returns, as in FMI. */
#define RIG_OK 0                  /* the outputs are used */
#define RIG_DISCARD 1             /* no answer to this sample: the last command is kept, for 100 ms at most */
#define RIG_ERROR 2               /* the rig trips with the message as reason; destroy is called */
#define RIG_FATAL 3               /* the rig trips with the message as reason; no function is called after it */

typedef struct rig_controller_abi_info {
  uint32_t abi;                   /* RIG_CONTROLLER_ABI that the library was compiled with */
  uint32_t levels;                /* RIG_LEVEL_... at which it can work; with both, the rig uses RIG_LEVEL_DUTY */
  uint32_t info_size;             /* sizes of the structs, as the library's compiler sees them */
  uint32_t parameter_size;
  uint32_t inputs_size;
  uint32_t outputs_size;
  const char *record;             /* RIG_CONTROLLER_RECORD that it was compiled with */
} rig_controller_abi_info;

typedef struct rig_parameter {
  const char *name;               /* e.g. "t12", "output_1.P1.time", "output_1.P1.current" */
  double value;                   /* SI */
} rig_parameter;

typedef struct rig_transducer {
  const char *name;               /* as `./rig list signals` prints it */
  const char *unit;               /* e.g. "rad/s" */
} rig_transducer;

typedef struct rig_gear {
  uint32_t number;
  const char *name;               /* e.g. "neutral" */
} rig_gear;

typedef struct rig_controller_info {
  uint32_t size;                  /* sizeof(rig_controller_info) of the rig */
  uint32_t level;                 /* RIG_LEVEL_... of this run */
  double period;                  /* time between samples [s] */
  double command_high;            /* largest command: 1, or the valves' current limit [A] */
  const rig_parameter *parameters;/* valid during create only, like all pointers in this struct */
  uint32_t parameter_count;
  char message[RIG_CONTROLLER_TEXT]; /* create may write the reason of its failure here */
  const char *record;             /* RIG_CONTROLLER_RECORD of the rig */
  const char *const *outputs;     /* names of the outputs, in the order of current, command and setpoint */
  const rig_transducer *transducers; /* in the order of measured */
  const rig_gear *gears;          /* gears that may be ordered */
  uint32_t output_count;
  uint32_t transducer_count;
  uint32_t gear_count;
} rig_controller_info;

typedef struct rig_controller_inputs {
  uint32_t size;                  /* sizeof(rig_controller_inputs) of the rig */
  uint32_t gear_request;          /* gear ordered last; it stays until the next order; 0 (neutral) after a trip */
  uint64_t sample;                /* index since time 0 */
  double time;                    /* sample x period [s] */
  const double *current;          /* measured coil currents, one for each output [A] */
  const double *measured;         /* the rig's transducers; rig_measured_of in rig_record.h gives them by name */
} rig_controller_inputs;

/* When step is called, every number except size is 0 and message is empty; command and setpoint point to arrays to fill. */
typedef struct rig_controller_outputs {
  uint32_t size;                  /* sizeof(rig_controller_outputs) of the rig */
  uint32_t flags;                 /* bit k: at level current, output k stays on at a setpoint of zero */
  uint32_t gear;                  /* gear that the controller accepted last */
  uint32_t shifting;              /* not 0: a shift is still running */
  double *command;                /* the library writes one command for each output here */
  double *setpoint;               /* current setpoint of each output [A], for display; not read at level current */
  char message[RIG_CONTROLLER_TEXT]; /* reason when the status is not RIG_OK */
} rig_controller_outputs;

#if defined(_WIN32)
#define RIG_EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define RIG_EXPORT __attribute__((visibility("default")))
#else
#define RIG_EXPORT
#endif

/* Body of rig_controller_abi: RIG_CONTROLLER_DESCRIBE(RIG_LEVEL_DUTY) */
#define RIG_CONTROLLER_DESCRIBE(levels_)                                              \
  static const rig_controller_abi_info description = {                                \
      RIG_CONTROLLER_ABI,                         (uint32_t)(levels_),                \
      (uint32_t)sizeof(rig_controller_info),      (uint32_t)sizeof(rig_parameter),    \
      (uint32_t)sizeof(rig_controller_inputs),    (uint32_t)sizeof(rig_controller_outputs), \
      RIG_CONTROLLER_RECORD};                                                         \
  return &description

/* Returns the description of the library; the pointer must stay valid. */
RIG_EXPORT const rig_controller_abi_info *rig_controller_abi(void);

/* Makes a new controller and stores it in *instance; with a status other than RIG_OK the run is refused. Only info->message may be
 * written. */
RIG_EXPORT int rig_controller_create(rig_controller_info *info, void **instance);

/* Computes one sample; its outputs act from the next sample on. */
RIG_EXPORT int rig_controller_step(void *instance, const rig_controller_inputs *inputs,
                                   rig_controller_outputs *outputs);

/* Frees a controller that create made. */
RIG_EXPORT void rig_controller_destroy(void *instance);

/* Optional, both functions or none: further transducers. The first function returns their names (`./rig list
 * signals` prints all), with NULL behind the last; the pointers stay valid. Before each step the rig calls the second function with
 * their SI values, in the same order. */
RIG_EXPORT const char *const *rig_controller_wants(void);
RIG_EXPORT void rig_controller_wanted(void *instance, const double *values, uint32_t count);

/* Optional, both functions or none: the controller's own signals, to be recorded. Names of letters, digits and underscores,
 * with NULL behind the last; the pointers stay valid. After each step with RIG_OK the library writes their values, in
 * the same order. */
RIG_EXPORT const char *const *rig_controller_signals(void);
RIG_EXPORT void rig_controller_signal_values(void *instance, double *values, uint32_t count);

/* Optional, both functions or none: the controller's own settings, which a sequence or a person may change during a run.
 * Names of letters, digits and underscores with their first values, and a NULL name behind the last; the pointer stays
 * valid. Before each step the rig calls the second function with the present values, in the same order. */
RIG_EXPORT const rig_parameter *rig_controller_settings(void);
RIG_EXPORT void rig_controller_set(void *instance, const double *values, uint32_t count);

/* Optional, both functions or none: the state of a controller, for FMUs (`./rig export controller-fmu`), whose importers may save it
 * and bring it back. The first function returns the state's size in bytes, which is not 0, and writes it where bytes is not NULL.
 * The second one takes these bytes, in any process, into a controller that was created with the same info; so they hold no pointer.
 * With a status other than RIG_OK it refuses them. */
RIG_EXPORT uint32_t rig_controller_save(void *instance, void *bytes);
RIG_EXPORT int rig_controller_load(void *instance, const void *bytes, uint32_t size);

#ifdef __cplusplus
}
#endif

#endif
