/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* The Alfa46 law in the form of generated code: profiles P1-P6, delays t12 to t32, PID on the coil current.
 *
 * It is written by hand in that form, to show what rig_shim.c wraps. It gives the same bits as the built-in controller:
 * ./rig simulate demo --controller simulink:rig_nodes/rig_nodes/controllers/examples/simulink
 */
#include "alfa46.h"

#include <math.h>
#include <string.h>

#define OFF 0
#define RISING 1
#define FALLING 2

ExtU rtU;
ExtY rtY;
P rtP;
DW rtDW;

/* Chart: switches the valves of the old and the new gear, one of them later by the delay of this change. */
static void alfa46_shift(uint8_T gear) {
  const uint8_T old = rtDW.gear;
  real_T delay = 0.0;
  real_T wait;
  real_T end;
  int32_T i;
  if (old == 1U && gear == 2U) {
    delay = rtP.t12;
  } else if (old == 2U && gear == 1U) {
    delay = rtP.t21;
  } else if (old == 2U && gear == 3U) {
    delay = rtP.t23;
  } else if (old == 3U && gear == 2U) {
    delay = rtP.t32;
  }
  wait = rint(delay / rtP.sample_time);
  rtDW.shift_end = rtU.sample;
  if (gear > 0U) {
    i = gear - 1;
    rtDW.next_phase[i] = RISING;
    rtDW.next_since[i] = rtU.sample + (wait > 0.0 ? wait : 0.0);
    end = rtDW.next_since[i] + rint(rtP.time[6 * i + 2] / rtP.sample_time);
    rtDW.shift_end = end > rtDW.shift_end ? end : rtDW.shift_end;
  }
  if (old > 0U) {
    i = old - 1;
    rtDW.next_phase[i] = FALLING;
    rtDW.next_since[i] = rtU.sample + (wait < 0.0 ? -wait : 0.0);
    end = rtDW.next_since[i] + rint(rtP.time[6 * i + 5] / rtP.sample_time);
    rtDW.shift_end = end > rtDW.shift_end ? end : rtDW.shift_end;
  }
  rtDW.gear = gear;
}

/* Lookup: straight lines over three points. They begin at 0 A after switch-on, and at the last setpoint after switch-off. */
static real_T alfa46_profile(int32_T i, real_T elapsed) {
  const int32_T first = 6 * i + (rtDW.phase[i] == RISING ? 0 : 3);
  real_T t0 = 0.0;
  real_T i0 = rtDW.phase[i] == RISING ? 0.0 : rtDW.from_current[i];
  int32_T k;
  for (k = first; k < first + 3; k++) {
    if (elapsed < rtP.time[k]) {
      return i0 + (rtP.current[k] - i0) * (elapsed - t0) / (rtP.time[k] - t0);
    }
    t0 = rtP.time[k];
    i0 = rtP.current[k];
  }
  return i0;
}

/* Discrete PID in volts: filtered derivative, the integral is limited to the supply voltage. */
static real_T alfa46_loop(int32_T i) {
  const real_T error = rtDW.setpoint[i] - rtU.current[i];
  const real_T slope = (error - rtDW.filtered[i]) / rtP.derivative_time;
  real_T integral;
  real_T duty;
  rtDW.filtered[i] += slope * rtP.sample_time;
  integral = rtDW.integral[i] + rtP.gain_i * error * rtP.sample_time;
  integral = integral > 0.0 ? integral : 0.0;
  rtDW.integral[i] = integral < rtP.supply_voltage ? integral : rtP.supply_voltage;
  duty = (rtP.gain_p * error + rtDW.integral[i] + rtP.gain_d * slope) / rtP.supply_voltage;
  duty = duty > 0.0 ? duty : 0.0;
  return duty < 1.0 ? duty : 1.0;
}

void alfa46_initialize(void) {
  memset(&rtU, 0, sizeof rtU);
  memset(&rtY, 0, sizeof rtY);
  memset(&rtDW, 0, sizeof rtDW);
}

void alfa46_step(void) {
  int32_T i;
  real_T elapsed;
  if (rtU.gear_request != rtDW.gear && rtU.sample >= rtDW.shift_end) {
    alfa46_shift(rtU.gear_request);
  }
  for (i = 0; i < 3; i++) {
    if (rtDW.next_phase[i] != OFF && rtU.sample >= rtDW.next_since[i]) {
      rtDW.phase[i] = rtDW.next_phase[i];
      rtDW.since[i] = rtDW.next_since[i];
      rtDW.from_current[i] = rtDW.setpoint[i];
      rtDW.next_phase[i] = OFF;
    }
    if (rtDW.phase[i] != OFF) {
      elapsed = (rtU.sample - rtDW.since[i]) * rtP.sample_time;
      rtDW.setpoint[i] = alfa46_profile(i, elapsed);
      if (rtDW.phase[i] == FALLING && elapsed > rtP.time[6 * i + 5] && rtDW.setpoint[i] <= 0.0) {
        rtDW.phase[i] = OFF;
      }
    }
    if (rtDW.phase[i] == OFF) {
      rtDW.setpoint[i] = 0.0;
      rtDW.integral[i] = 0.0;
      rtDW.filtered[i] = -rtU.current[i];
      rtY.duty[i] = 0.0;
    } else {
      rtY.duty[i] = alfa46_loop(i);
    }
    rtY.setpoint[i] = rtDW.setpoint[i];
    rtY.on[i] = (boolean_T)(rtDW.phase[i] != OFF);
  }
  rtY.gear = rtDW.gear;
  rtY.shifting = (boolean_T)(rtU.sample < rtDW.shift_end);
}

void alfa46_terminate(void) {
  /* there is nothing to free */
}
