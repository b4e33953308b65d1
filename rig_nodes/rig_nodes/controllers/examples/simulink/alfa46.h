/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* The Alfa46 law in the form of generated code: global inputs, outputs, parameters and states, and three functions. */
#ifndef RTW_HEADER_alfa46_h_
#define RTW_HEADER_alfa46_h_

#include "rtwtypes.h"

/* External inputs */
typedef struct {
  real_T sample;
  uint8_T gear_request;
  real_T current[3];  /* A */
} ExtU;

/* External outputs */
typedef struct {
  real_T duty[3];
  real_T setpoint[3]; /* A */
  boolean_T on[3];
  uint8_T gear;
  boolean_T shifting;
} ExtY;

/* Tunable parameters */
typedef struct {
  real_T sample_time;
  real_T supply_voltage;
  real_T gain_p;
  real_T gain_i;
  real_T gain_d;
  real_T derivative_time;
  real_T t12;
  real_T t21;
  real_T t23;
  real_T t32;
  real_T time[18];    /* P1-P6 of output 1, then 2, then 3 [s] */
  real_T current[18]; /* [A] */
} P;

/* Block states */
typedef struct {
  int32_T phase[3];
  int32_T next_phase[3];
  real_T since[3];
  real_T next_since[3];
  real_T from_current[3];
  real_T setpoint[3];
  real_T integral[3];
  real_T filtered[3];
  real_T shift_end;
  uint8_T gear;
} DW;

extern ExtU rtU;
extern ExtY rtY;
extern P rtP;
extern DW rtDW;

extern void alfa46_initialize(void);
extern void alfa46_step(void);
extern void alfa46_terminate(void);

#endif
