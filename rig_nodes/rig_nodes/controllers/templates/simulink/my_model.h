/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* A placeholder for the header that Simulink Coder generates: global inputs rtU, global outputs rtY, and three functions. */
#ifndef RTW_HEADER_my_model_h_
#define RTW_HEADER_my_model_h_

#include "rtwtypes.h"

typedef struct {
  real_T time;         /* s */
  uint8_T gear_request;
  uint8_T outputs;     /* those that the ordered gear needs, bit k for output k */
  real_T n_in;         /* rad/s */
} ExtU;

typedef struct {
  real_T current[8];   /* A */
  uint8_T gear;
  boolean_T shifting;
} ExtY;

extern ExtU rtU;
extern ExtY rtY;

extern void my_model_initialize(void);
extern void my_model_step(void);
extern void my_model_terminate(void);

#endif
