/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* The controller's side of the UDP protocol (docs/how_to/udp.md), in C, for a shift controller of rig_controller.h.
 *
 * It needs a POSIX system with little-endian numbers and a compiler that supports weak symbols (gcc, clang). Link it with
 * your functions of rig_controller.h and call rig_udp_serve; examples/udp_main.c is a whole program. This file computes
 * nothing: it fetches the parameters, passes each sample to rig_controller_step once, and repeats the same answer when
 * the sample comes again.
 */
#ifndef RIG_UDP_H
#define RIG_UDP_H

#include "rig_controller.h"

#include <arpa/inet.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "the frames are little-endian: this machine would have to swap the bytes of every number"
#endif

#define RIG_UDP_MAGIC 0x31474952u /* "RIG1" */
#define RIG_UDP_VERSION 3u
#define RIG_UDP_PORT 9002
#define RIG_UDP_MOST 224 /* largest count of numbers in a sample or an answer */
#define RIG_UDP_NAMES 256 /* largest number of entries in one of the rig's lists */
enum { RIG_HELLO = 1, RIG_INFO, RIG_ASK, RIG_NAME, RIG_READY, RIG_SAMPLE, RIG_ANSWER, RIG_BYE, RIG_OWN };
/* the rig's lists of names; a frame NAME states to which list its name belongs */
enum { RIG_LIST_SETTINGS, RIG_LIST_OUTPUTS, RIG_LIST_TRANSDUCERS, RIG_LIST_GEARS, RIG_LISTS };
enum { RIG_WANT = 1, RIG_SIGNAL, RIG_SETTING }; /* kind of the name in a frame OWN */
enum { RIG_UDP_AGAIN = 200, RIG_UDP_REFUSED = 1000, RIG_UDP_KEEP_ALIVE = 500, RIG_UDP_RESEND = 20, RIG_UDP_TRIES = 50 }; /* ms; times */
/* Priority of real time, as of the rig's own nodes: with less, the controller waits for them on a busy machine. */
enum { RIG_UDP_PRIORITY = 10 };

/* Every member lies at a multiple of its size, so that no compiler leaves gaps. */
typedef struct {
  uint32_t magic;
  uint16_t version, kind;
  uint32_t session, frame, size, reserved;
} rig_udp_header;

typedef struct {
  rig_udp_header header;
  union {
    struct { uint32_t levels, reserved; char record[16]; } hello;
    struct { uint32_t level, reserved, count[RIG_LISTS]; double period, command_high; char record[16]; } info;
    struct { uint32_t index, list; } ask;
    struct { uint32_t index, list; double value; char name[48], unit[16]; } name;
    struct { uint32_t count, reserved; } ready;
    struct { uint32_t index, what; double first; char name[48], unit[16]; } own;
    struct {
      uint64_t sample;
      double time;
      uint32_t gear_request, reserved;
      double more[RIG_UDP_MOST]; /* currents, transducers, further transducers, settings of the controller */
    } sample;
    struct {
      uint32_t status, gear, shifting, flags;
      char message[RIG_CONTROLLER_TEXT];
      double more[RIG_UDP_MOST]; /* commands, setpoints, signals of the controller */
    } answer;
    struct { char message[RIG_CONTROLLER_TEXT]; } bye;
  } body;
} rig_udp_frame;

/* The optional functions of a controller. */
extern const char *const *rig_controller_wants(void) __attribute__((weak));
extern void rig_controller_wanted(void *instance, const double *values, uint32_t count) __attribute__((weak));
extern const char *const *rig_controller_signals(void) __attribute__((weak));
extern void rig_controller_signal_values(void *instance, double *values, uint32_t count) __attribute__((weak));
extern const rig_parameter *rig_controller_settings(void) __attribute__((weak));
extern void rig_controller_set(void *instance, const double *values, uint32_t count) __attribute__((weak));

typedef struct {
  int socket, running, refused;
  uint32_t wants, signals, settings; /* numbers of the controller's names */
  uint32_t outputs, transducers;     /* numbers of the rig's outputs and transducers */
  uint32_t session, last;
  long long hello_at; /* time [ms] from which on a controller that waits says HELLO */
  rig_udp_frame answer;
  void *instance;
  rig_controller_inputs inputs;
  unsigned long ignored; /* number of packets that were not used */
  char told[RIG_CONTROLLER_TEXT]; /* the rig's last message, which it repeats every second; it is printed once */
} rig_udp_client;

/* A signal handler sets it; rig_udp_serve then sends a BYE and returns. */
static volatile sig_atomic_t rig_udp_stop;

static long long rig_udp_now(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return 1000LL * now.tv_sec + now.tv_nsec / 1000000;
}

static uint32_t rig_udp_size(unsigned kind) {
  static const uint32_t body[] = {0, 24, 56, 8, 80, 8, 24, 16 + RIG_CONTROLLER_TEXT, RIG_CONTROLLER_TEXT, 80};
  return kind >= RIG_HELLO && kind <= RIG_OWN ? (uint32_t)sizeof(rig_udp_header) + body[kind] : 0u;
}

static void rig_udp_send(rig_udp_client *client, rig_udp_frame *frame, unsigned kind, uint32_t number) {
  frame->header.magic = RIG_UDP_MAGIC;
  frame->header.version = RIG_UDP_VERSION;
  frame->header.kind = (uint16_t)kind;
  frame->header.session = client->session;
  frame->header.frame = number;
  frame->header.size = rig_udp_size(kind) + (kind == RIG_ANSWER ? 8u * (2u * client->outputs + client->signals) : 0u);
  frame->header.reserved = 0;
  if (send(client->socket, frame, frame->header.size, 0) < 0) return; /* no rig is listening yet; the caller tries again */
}

static void rig_udp_hello(rig_udp_client *client) {
  const char *record = rig_controller_abi()->record;
  rig_udp_frame frame;
  memset(&frame, 0, sizeof frame);
  frame.body.hello.levels = rig_controller_abi()->levels;
  if (record) memcpy(frame.body.hello.record, record, strlen(record) < 16 ? strlen(record) : 16);
  rig_udp_send(client, &frame, RIG_HELLO, 0);
}

/* Counts a packet that is not used; the first, tenth, hundredth and so on is printed. */
static void rig_udp_ignore(rig_udp_client *client, const char *why) {
  unsigned long count = ++client->ignored;
  while (count % 10u == 0u) count /= 10u;
  if (count == 1u) fprintf(stderr, "frame %lu that is ignored: %s\n", client->ignored, why);
}

/* Waits for a frame for at most `ms`; returns 1 with a frame, or 0. Packets of other forms are ignored. */
static int rig_udp_receive(rig_udp_client *client, rig_udp_frame *frame, int ms) {
  struct pollfd look = {client->socket, POLLIN, 0};
  while (poll(&look, 1, ms) > 0) {
    const ssize_t size = recv(client->socket, frame, sizeof *frame, 0);
    if (size < 0) { /* there is no rig yet */
      const struct timespec pause = {0, 100000000};
      nanosleep(&pause, NULL);
      return 0;
    }
    if (size >= (ssize_t)sizeof frame->header && frame->header.magic == RIG_UDP_MAGIC &&
        frame->header.version == RIG_UDP_VERSION && (uint32_t)size == frame->header.size &&
        frame->header.size == rig_udp_size(frame->header.kind) +
                                  (frame->header.kind == RIG_SAMPLE
                                       ? 8u * (client->outputs + client->transducers + client->wants + client->settings)
                                       : 0u))
      return 1;
    rig_udp_ignore(client, "it is none of this version of the protocol, or of another length; the rig's rig_udp.h must be this one");
  }
  return 0;
}

static void rig_udp_end(rig_udp_client *client) {
  if (client->running) rig_controller_destroy(client->instance);
  client->running = 0;
  client->session = 0;
}

/* Counts the further transducers, the signals and the settings of the controller. */
static void rig_udp_count(rig_udp_client *client) {
  const char *const *wants = rig_controller_wants && rig_controller_wanted ? rig_controller_wants() : NULL;
  const char *const *signals =
      rig_controller_signals && rig_controller_signal_values ? rig_controller_signals() : NULL;
  const rig_parameter *settings = rig_controller_settings && rig_controller_set ? rig_controller_settings() : NULL;
  client->wants = client->signals = client->settings = 0;
  while (wants && wants[client->wants] && client->wants < RIG_UDP_MOST / 2) client->wants++;
  while (signals && signals[client->signals] && client->signals < RIG_UDP_MOST) client->signals++;
  while (settings && settings[client->settings].name && client->settings < RIG_UDP_MOST / 2) client->settings++;
}

static void rig_udp_own(rig_udp_client *client, uint32_t index) {
  rig_udp_frame frame;
  const char *name;
  memset(&frame, 0, sizeof frame);
  frame.body.own.index = index;
  if (index < client->wants) {
    frame.body.own.what = RIG_WANT;
    name = rig_controller_wants()[index];
  } else if ((index -= client->wants) < client->signals) {
    frame.body.own.what = RIG_SIGNAL;
    name = rig_controller_signals()[index];
    frame.body.own.unit[0] = '-';
  } else if ((index -= client->signals) < client->settings) {
    frame.body.own.what = RIG_SETTING;
    name = rig_controller_settings()[index].name;
    frame.body.own.first = rig_controller_settings()[index].value;
  } else {
    return;
  }
  snprintf(frame.body.own.name, sizeof frame.body.own.name, "%s", name);
  rig_udp_send(client, &frame, RIG_OWN, 0);
}

static void rig_udp_ready(rig_udp_client *client) {
  rig_udp_frame frame;
  memset(&frame, 0, sizeof frame);
  frame.body.ready.count = client->wants + client->signals + client->settings;
  rig_udp_send(client, &frame, RIG_READY, 0);
}

/* Requests one of the rig's names until it arrives; returns 0 when the rig no longer answers or has another session. */
static int rig_udp_name(rig_udp_client *client, uint32_t list, uint32_t index, rig_udp_frame *frame) {
  for (int tries = 0; tries < RIG_UDP_TRIES && !rig_udp_stop; tries++) {
    rig_udp_frame ask;
    memset(&ask, 0, sizeof ask);
    ask.body.ask.index = index;
    ask.body.ask.list = list;
    rig_udp_send(client, &ask, RIG_ASK, 0);
    while (rig_udp_receive(client, frame, RIG_UDP_RESEND)) {
      if (frame->header.session != client->session) continue;
      if (frame->header.kind == RIG_BYE) return 0;
      if (frame->header.kind == RIG_NAME && frame->body.name.index == index && frame->body.name.list == list) return 1;
    }
  }
  return 0;
}

/* The rig's lists, which are needed during create. */
typedef struct {
  char name[RIG_LISTS][RIG_UDP_NAMES][48], unit[RIG_UDP_NAMES][17], record[17]; /* units of the transducers */
  rig_parameter parameters[RIG_UDP_NAMES];
  const char *outputs[RIG_UDP_NAMES];
  rig_transducer transducers[RIG_UDP_NAMES];
  rig_gear gears[RIG_UDP_NAMES];
} rig_udp_names;

/* Fetches all lists; returns 0 when the rig no longer answers. */
static int rig_udp_fetch(rig_udp_client *client, const uint32_t *count, rig_udp_names *names) {
  rig_udp_frame frame;
  for (uint32_t list = 0; list < RIG_LISTS; list++) {
    for (uint32_t k = 0; k < count[list]; k++) {
      char *name = names->name[list][k];
      if (!rig_udp_name(client, list, k, &frame)) return 0;
      memcpy(name, frame.body.name.name, 47);
      if (list == RIG_LIST_SETTINGS) {
        names->parameters[k].name = name;
        names->parameters[k].value = frame.body.name.value;
      } else if (list == RIG_LIST_OUTPUTS) {
        names->outputs[k] = name;
      } else if (list == RIG_LIST_TRANSDUCERS) {
        memcpy(names->unit[k], frame.body.name.unit, 16);
        names->transducers[k].name = name;
        names->transducers[k].unit = names->unit[k];
      } else {
        names->gears[k].number = (uint32_t)frame.body.name.value;
        names->gears[k].name = name;
      }
    }
  }
  return 1;
}

/* Begins a run: fetches the rig's names, creates the controller, and reports that it is ready. */
static void rig_udp_begin(rig_udp_client *client, const rig_udp_frame *first) {
  rig_udp_names *names = (rig_udp_names *)calloc(1, sizeof *names);
  uint32_t count[RIG_LISTS];
  rig_udp_frame frame;
  for (int k = 0; k < RIG_LISTS; k++) count[k] = first->body.info.count[k];
  rig_udp_count(client);
  if (count[RIG_LIST_SETTINGS] > RIG_UDP_NAMES || count[RIG_LIST_GEARS] > RIG_UDP_NAMES ||
      count[RIG_LIST_OUTPUTS] > RIG_UDP_MOST / 4 || count[RIG_LIST_TRANSDUCERS] > RIG_UDP_MOST / 4 ||
      2u * count[RIG_LIST_OUTPUTS] + client->signals > RIG_UDP_MOST ||
      (first->body.info.level != RIG_LEVEL_DUTY && first->body.info.level != RIG_LEVEL_CURRENT)) {
    rig_udp_ignore(client, "a rig's INFO has an unknown level, or more names than fit into a frame");
    free(names);
    return;
  }
  rig_udp_end(client);
  client->session = first->header.session;
  if (names && rig_udp_fetch(client, count, names)) {
    rig_controller_info info;
    memset(&info, 0, sizeof info);
    info.size = sizeof info;
    info.level = first->body.info.level;
    info.period = first->body.info.period;
    info.command_high = first->body.info.command_high;
    info.parameters = names->parameters;
    info.parameter_count = count[RIG_LIST_SETTINGS];
    memcpy(names->record, first->body.info.record, 16);
    info.record = names->record;
    info.outputs = names->outputs;
    info.transducers = names->transducers;
    info.gears = names->gears;
    info.output_count = client->outputs = count[RIG_LIST_OUTPUTS];
    info.transducer_count = client->transducers = count[RIG_LIST_TRANSDUCERS];
    info.gear_count = count[RIG_LIST_GEARS];
    if (rig_controller_create(&info, &client->instance) == RIG_OK) {
      client->running = 1;
      client->last = 0;
      client->told[0] = '\0';
      rig_udp_ready(client);
    } else {
      info.message[sizeof info.message - 1] = '\0';
      fprintf(stderr, "the controller refuses: %s\n", info.message);
      memset(&frame, 0, sizeof frame);
      memcpy(frame.body.bye.message, info.message, sizeof frame.body.bye.message);
      rig_udp_send(client, &frame, RIG_BYE, 0);
      client->refused = 1;
    }
  } else {
    client->session = 0;
  }
  free(names);
}

static void rig_udp_step(rig_udp_client *client, const rig_udp_frame *frame) {
  rig_controller_inputs *in = &client->inputs;
  rig_controller_outputs out;
  rig_udp_frame *answer = &client->answer;
  const double *more = frame->body.sample.more;
  int status;
  if (frame->header.frame < client->last) return;
  if (frame->header.frame > client->last) {
    memset(&out, 0, sizeof out);
    out.size = sizeof out;
    in->size = sizeof *in;
    in->gear_request = frame->body.sample.gear_request;
    in->sample = frame->body.sample.sample;
    in->time = frame->body.sample.time;
    in->current = more;
    in->measured = more += client->outputs;
    more += client->transducers;
    if (client->wants) rig_controller_wanted(client->instance, more, client->wants);
    if (client->settings) rig_controller_set(client->instance, more + client->wants, client->settings);
    memset(answer, 0, sizeof *answer);
    out.command = answer->body.answer.more;
    out.setpoint = out.command + client->outputs;
    status = rig_controller_step(client->instance, in, &out);
    if (client->signals && status == RIG_OK)
      rig_controller_signal_values(client->instance, answer->body.answer.more + 2 * client->outputs, client->signals);
    answer->body.answer.status = (uint32_t)status;
    answer->body.answer.gear = out.gear;
    answer->body.answer.shifting = out.shifting != 0u;
    answer->body.answer.flags = out.flags;
    memcpy(answer->body.answer.message, out.message, sizeof out.message - 1);
    client->last = frame->header.frame;
  }
  rig_udp_send(client, answer, RIG_ANSWER, client->last);
}

static void rig_udp_told(rig_udp_client *client, rig_udp_frame *frame) {
  frame->body.bye.message[sizeof frame->body.bye.message - 1] = '\0';
  if (strcmp(client->told, frame->body.bye.message) == 0) return;
  memcpy(client->told, frame->body.bye.message, sizeof client->told);
  fprintf(stderr, "message of the rig: %s\n", frame->body.bye.message);
}

/* Answers the rig at a numeric address, e.g. "127.0.0.1", and port until rig_udp_stop is set, or with `once` until the first
 * run ends. Rig and controller may start in any order. Returns 0 at an orderly end, and 1 when there is no such address or
 * the controller refuses a run. */
static int rig_udp_serve(const char *host, int port, int once) {
  static rig_udp_client client;
  struct sockaddr_in rig;
  rig_udp_frame frame;
  struct sched_param priority;
  int over = 0;
  memset(&rig, 0, sizeof rig);
  memset(&priority, 0, sizeof priority);
  rig.sin_family = AF_INET;
  rig.sin_port = htons((uint16_t)port);
  if (inet_pton(AF_INET, host, &rig.sin_addr) != 1 || port < 1 || port > 65535) {
    fprintf(stderr, "there is no rig at %s port %d; expected an address such as 127.0.0.1 and a port, e.g. %d\n", host,
            port, RIG_UDP_PORT);
    return 1;
  }
  client.socket = socket(AF_INET, SOCK_DGRAM, 0);
  if (client.socket < 0 || connect(client.socket, (struct sockaddr *)&rig, sizeof rig) != 0) {
    perror(host);
    return 1;
  }
  priority.sched_priority = RIG_UDP_PRIORITY;
  (void)sched_setscheduler(0, SCHED_FIFO, &priority); /* it fails without the right, which is no error */
  printf("waiting for the rig at %s:%d, until Ctrl-C\n", host, port);
  fflush(stdout);
  while (!rig_udp_stop && !client.refused && !(over && once)) {
    if (!client.running && rig_udp_now() >= client.hello_at) rig_udp_hello(&client);
    if (!rig_udp_receive(&client, &frame, client.running && client.last ? RIG_UDP_KEEP_ALIVE : RIG_UDP_AGAIN)) {
      if (client.running && !client.last) rig_udp_ready(&client); /* repeated until a sample arrives */
      else if (client.running) rig_udp_hello(&client); /* checks whether the same rig still answers */
    } else if (frame.header.kind == RIG_INFO && frame.header.session != client.session) {
      rig_udp_begin(&client, &frame);
    } else if (frame.header.kind == RIG_BYE && frame.header.session == 0 && !client.running) {
      rig_udp_told(&client, &frame);
      client.hello_at = rig_udp_now() + RIG_UDP_REFUSED;
    } else if (frame.header.session == client.session && client.running) {
      if (frame.header.kind == RIG_ASK) rig_udp_own(&client, frame.body.ask.index);
      if (frame.header.kind == RIG_SAMPLE) rig_udp_step(&client, &frame);
      if (frame.header.kind == RIG_BYE) {
        if (!client.last) rig_udp_told(&client, &frame);
        rig_udp_end(&client);
        over = 1;
      }
    }
  }
  if (client.running) {
    memset(&frame, 0, sizeof frame);
    snprintf(frame.body.bye.message, sizeof frame.body.bye.message, "the controller was stopped");
    rig_udp_send(&client, &frame, RIG_BYE, 0);
    rig_udp_end(&client);
  }
  close(client.socket);
  return client.refused;
}

#endif
