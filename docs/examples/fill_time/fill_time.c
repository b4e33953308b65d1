/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* A shift controller in C99 that learns how long each clutch of the rig hydmag fills.
 *
 *   ./rig simulate docs/examples/fill_time/shifts.yaml --controller c:docs/examples/fill_time/fill_time.c
 *   ./rig export controller-fmu docs/examples/fill_time/fill_time.c -o fill_time.fmu
 *   .venv/bin/python -m rig_nodes.controllers.examples.can_alfa46 239.74.163.2 --interface udp_multicast --rig hydmag \
 *       --controller c:docs/examples/fill_time/fill_time.c
 *
 * A fill is open-loop: a high current until shortly before the moment at which the piston is expected to touch the plates, then the
 * current of a pressure that takes it there. The pressure tells when it does touch them: the plates are stiffer than the return springs,
 * so the pressure's slope has a knee, by which US patent 7,574,906 (2009) finds a fill volume; without a pressure transducer the first
 * response of the speed shows it (US 6,115,661). A share of the time between the expected and the observed moment is added to the
 * learned fill time, when the shift is fit to be learned from.
 */
#include "rig_record.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { CLUTCHES = 2, MEAN = 20 }; /* samples of one period of the mains, over which the hum of a transducer cancels */

/* What the box is calibrated to; all assumed, but for the fill times, which are those of a new rig at 40 degC. */
static const double DATA[CLUTCHES] = {0.075, 0.455}; /* fill times [s] */
static const double WRONG = 0.7;                     /* share of them with which this example begins */
static const double FULL = 0.74, HOLD[CLUTCHES] = {0.19, 0.235}; /* while it fills, then until the knee [A] */
static const double LEAD = 0.025;     /* from the end of the high current to the knee, for coil and spool [s] */
static const double RAMP = 1.2;       /* after the knee [A/s] */
static const double OVERLAP = 0.05, RELEASED = 0.2, RELEASE = 0.13; /* of the old clutch after the knee: held [s], let go [s], [A] */
static const double PATIENCE = 0.3;   /* after the expected knee; then the ramp begins without one [s] */
static const double LENGTH = 2.0;     /* of a shift [s] */
static const double MOVES = 0.03e6, SETTLE = 0.04; /* rise that shows a moving piston [Pa], and the time until only springs raise it [s] */
static const double KNEE = 0.08e6, SEEN = 0.002;   /* rise over MEAN samples that only plates cause [Pa], and the time that it takes [s] */

/* When the box may learn, and how much. */
static const double COLDEST = 15.0, WARMEST = 110.0; /* oil [degC]; where nobody tells it, as on CAN, it counts as within */
static const double SLOWEST = 30.0, FASTEST = 260.0, STEADY = 0.03; /* input speed [rad/s]; its change until the knee, as a share */
static const double EMPTY = 9.0, UNPRESSED = 0.1e6;   /* of the clutch at the order: let go for so long [s], pressure below [Pa] */
static const double SHARE = 0.7;                      /* of an error, which is learned from one shift */
static const double STEP = 0.08, LEAST = 0.5, MOST = 2.0; /* limits: per shift [s]; in all, as shares of DATA */

enum { REST, FILLING, HOLDING, CLOSING };
enum { LEARNED, NOT_GEARS, NOT_OIL, NOT_SPEED, NOT_EMPTY, NOT_READ, BROKEN_OFF }; /* verdict on the newest shift */

typedef struct {
  double fill[CLUTCHES], given[CLUTCHES]; /* learned, and set from outside last [s] */
  double let_go[CLUTCHES];                /* time of the order that opened a clutch [s] */
  double past[CLUTCHES][MEAN];            /* newest pressures [Pa] */
  double since, closing;                  /* times of the order and of the ramp's begin [s] */
  double speed, base, moving, knee;       /* input speed and pressure at the order; after it, the piston's first move and the knee [s] */
  double oil;                             /* degC; NaN when nobody tells it */
  int phase, verdict, from, to;           /* from, to: clutches, -1 for none */
  uint32_t gear;
} box_t;

static double between(double value, double low, double high) { return value < low ? low : value > high ? high : value; }

static int clutch_of(uint32_t gear) {
  for (int k = 0; k < CLUTCHES; k++)
    if (rig_outputs_of(gear) >> k & 1) return k;
  return -1;
}

/* What stands against learning from a shift at its order. */
static int fit(const box_t *box, double time) {
  if (box->from < 0) return NOT_GEARS;
  if (box->oil < COLDEST || box->oil > WARMEST) return NOT_OIL;
  if (!(box->speed >= SLOWEST && box->speed <= FASTEST)) return NOT_SPEED;
  if (time - box->let_go[box->to] < EMPTY || !(box->base < UNPRESSED)) return NOT_EMPTY;
  return LEARNED;
}

static void order(box_t *box, const rig_controller_inputs *in) {
  const int broken_off = box->phase == FILLING || box->phase == HOLDING;
  box->from = clutch_of(box->gear);
  box->to = clutch_of(in->gear_request);
  box->gear = in->gear_request;
  box->since = in->time;
  if (box->from >= 0) box->let_go[box->from] = in->time;
  box->phase = box->to < 0 ? REST : FILLING;
  if (box->to < 0) {
    if (broken_off) box->verdict = BROKEN_OFF;
    return;
  }
  box->speed = rig_measured_of(in)->n_wej;
  box->base = 0.0;
  for (int n = 0; n < MEAN; n++) box->base += box->past[box->to][n] / MEAN;
  box->moving = box->knee = 0.0;
  box->verdict = fit(box, in->time);
}

/* Takes the moment of the knee after the order; where none was seen, it comes at least that late. */
static void close_clutch(box_t *box, const rig_controller_inputs *in, double knee) {
  const double error = knee - box->fill[box->to], speed = rig_measured_of(in)->n_wej;
  box->phase = CLOSING;
  box->closing = in->time;
  box->knee = knee;
  if (box->verdict == LEARNED && !(fabs(speed - box->speed) <= STEADY * box->speed)) box->verdict = NOT_SPEED;
  if (box->verdict == LEARNED && box->moving == 0.0) box->verdict = NOT_READ; /* no oil has come, or no reading */
  if (box->verdict != LEARNED) return;
  box->fill[box->to] += between(SHARE * error, -STEP, STEP);
  box->fill[box->to] = between(box->fill[box->to], LEAST * DATA[box->to], MOST * DATA[box->to]);
}

/* Follows a fill by the pressure of its clutch and its rise over MEAN samples, until the knee. */
static void follow_fill(box_t *box, const rig_controller_inputs *in, double pressure, double rise) {
  const double elapsed = in->time - box->since, fill = box->fill[box->to];
  if (box->moving == 0.0 && pressure - box->base > MOVES) box->moving = elapsed;
  if (box->moving > 0.0 && elapsed > box->moving + SETTLE && rise > KNEE) {
    close_clutch(box, in, elapsed - SEEN);
  } else if (elapsed > fill + PATIENCE) {
    close_clutch(box, in, elapsed);
  } else if (elapsed > fill - LEAD) {
    box->phase = HOLDING;
  }
}

const rig_controller_abi_info *rig_controller_abi(void) { RIG_CONTROLLER_DESCRIBE(RIG_LEVEL_CURRENT); }

int rig_controller_create(rig_controller_info *info, void **instance) {
  box_t *box;
  if (info->size != sizeof *info) return RIG_ERROR;
  box = calloc(1, sizeof *box);
  if (!box) return RIG_ERROR;
  for (int k = 0; k < CLUTCHES; k++) {
    box->fill[k] = box->given[k] = WRONG * DATA[k];
    box->let_go[k] = -EMPTY;
  }
  box->oil = NAN;
  box->from = box->to = -1;
  box->since = -LENGTH;
  *instance = box;
  return RIG_OK;
}

int rig_controller_step(void *instance, const rig_controller_inputs *in, rig_controller_outputs *out) {
  box_t *box = instance;
  const double pressures[CLUTCHES] = {rig_measured_of(in)->p1, rig_measured_of(in)->p2};
  const int place = (int)(in->sample % MEAN);
  double rise = 0.0;
  if (in->gear_request != box->gear) order(box, in);
  for (int k = 0; k < CLUTCHES; k++) {
    if (k == box->to) rise = pressures[k] - box->past[k][place];
    box->past[k][place] = pressures[k];
  }
  if (box->phase == FILLING || box->phase == HOLDING) follow_fill(box, in, pressures[box->to], rise);
  if (box->to >= 0) {
    const double closed = box->phase == CLOSING ? in->time - box->closing : 0.0;
    const double hold = HOLD[box->to] + RAMP * closed;
    out->command[box->to] = box->phase == FILLING || hold > FULL ? FULL : hold;
    if (box->from >= 0 && closed < OVERLAP + RELEASED) out->command[box->from] = closed < OVERLAP ? FULL : RELEASE;
  }
  out->gear = box->gear;
  out->shifting = in->time - box->since < LENGTH;
  return RIG_OK;
}

void rig_controller_destroy(void *instance) { free(instance); }

/* The temperature of the oil is no transducer of the record; C and FMU bring it, CAN does not. */
const char *const *rig_controller_wants(void) {
  static const char *const names[] = {"T_oil", NULL};
  return names;
}

void rig_controller_wanted(void *instance, const double *values, uint32_t count) {
  if (count) ((box_t *)instance)->oil = values[0];
}

/* Learned fill times [s], knee after the order [s] and verdict of the newest shift. */
const char *const *rig_controller_signals(void) {
  static const char *const names[] = {"fill_1", "fill_2", "knee", "verdict", NULL};
  return names;
}

void rig_controller_signal_values(void *instance, double *values, uint32_t count) {
  const box_t *box = instance;
  const double all[] = {box->fill[0], box->fill[1], box->knee, (double)box->verdict};
  memcpy(values, all, sizeof(double) * (count < 4 ? count : 4));
}

/* Fill times to go on from [s]: a new value is taken as learned. */
const rig_parameter *rig_controller_settings(void) {
  static rig_parameter first[CLUTCHES + 1] = {{"begin_1", 0.0}, {"begin_2", 0.0}, {NULL, 0.0}};
  for (int k = 0; k < CLUTCHES; k++) first[k].value = WRONG * DATA[k];
  return first;
}

void rig_controller_set(void *instance, const double *values, uint32_t count) {
  box_t *box = instance;
  for (uint32_t k = 0; k < count && k < CLUTCHES; k++) {
    if (values[k] != box->given[k]) box->fill[k] = box->given[k] = values[k];
  }
}

uint32_t rig_controller_save(void *instance, void *bytes) {
  if (bytes) memcpy(bytes, instance, sizeof(box_t));
  return sizeof(box_t);
}

int rig_controller_load(void *instance, const void *bytes, uint32_t size) {
  if (size != sizeof(box_t)) return RIG_ERROR;
  memcpy(instance, bytes, size);
  return RIG_OK;
}
