/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* The outputs, transducers and gears of the rig hydmag by name, for rig_controller.h.
 *
 * ./rig export record --rig hydmag writes this file; write it again rather than change it. A controller
 * that is compiled with it runs only on a rig that has the same names and units in the same order.
 */
#ifndef RIG_RECORD_H
#define RIG_RECORD_H

#include "rig_controller.h"

#undef RIG_CONTROLLER_RECORD
#define RIG_CONTROLLER_RECORD "71936010db1197cd"

enum { RIG_OUTPUTS = 3, RIG_TRANSDUCERS = 4 };
enum { RIG_OUTPUT_1 = 0, RIG_OUTPUT_2 = 1, RIG_OUTPUT_3 = 2 }; /* places in current, command and setpoint */
enum { RIG_GEAR_NEUTRAL = 0, RIG_GEAR_I = 1, RIG_GEAR_II = 2 };

/* Outputs that a gear needs, bit k for output k: those of the valves of its clutches. */
static inline uint32_t rig_outputs_of(uint32_t gear) {
  static const uint8_t outputs[] = {0x00, 0x01, 0x02};
  return gear < sizeof outputs ? outputs[gear] : 0;
}

typedef struct rig_measured {
  double n_wej; /* Speed of the input shaft w0 [rad/s]; positive in the driving direction */
  double n_wyj; /* Speed of the output shaft wk [rad/s]; positive in the driving direction */
  double p1; /* Pressure in the cylinder of clutch S1 [Pa]; gauge, positive above ambient */
  double p2; /* Pressure in the cylinder of clutch S2 [Pa]; gauge, positive above ambient */
} rig_measured;

static inline const rig_measured *rig_measured_of(const rig_controller_inputs *in) {
  return (const rig_measured *)in->measured;
}

#endif
