/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* The rig as the model of an FMU: a process of the rig's own Python at the other end of a socket pair.
 *
 * resources/tool.txt names the interpreter and the folder of the package, in two lines; the environment variables
 * RIG_FMU_PYTHON and RIG_FMU_PATH take precedence. Each request is one message and has one answer
 * (rig_nodes/runs/fmu/rig_process.py). The process ends when its socket is closed, so it never outlives its importer.
 */
#define _GNU_SOURCE
#include "model.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

extern char **environ;

enum { INITIALIZE = 1, STEP, TERMINATE, RESET, SAVE, RESTORE };
enum { CHILD_END = 3, PATH_SIZE = 4096, END_TIME_MS = 3000, PIECE = 32768 /* bytes of a state in one message */ };

typedef struct {
  uint32_t what, samples; /* RESTORE: bytes of the state, which follows */
  model_values values;
} request;

typedef struct {
  uint32_t status, samples; /* samples: number of samples that a step has computed; SAVE: bytes of the state, which follows */
  model_values values;
  char sentence[MODEL_TEXT];
} answer;

struct model {
  model_values *values;
  model_say say;
  void *importer;
  pid_t process;
  int socket;
  char python[PATH_SIZE];
  request request;
  answer answer;
};

static int fail(model *m, int status, const char *sentence) {
  m->say(m->importer, status, sentence);
  return status;
}

static void read_line(FILE *file, char *line) {
  line[0] = 0;
  if (file && fgets(line, PATH_SIZE, file)) line[strcspn(line, "\r\n")] = 0;
}

/* Waits at most patience_ms for the end of the process; returns 1 when it has ended, with its status in *status. */
static int wait_for_end(pid_t process, int patience_ms, int *status) {
  const struct timespec moment = {0, 5000000};
  *status = 0;
  for (int waited = 0;; waited += 5) {
    const pid_t ended = waitpid(process, status, WNOHANG);
    if (ended == process || (ended < 0 && errno == ECHILD)) return 1;
    if (waited >= patience_ms) return 0;
    nanosleep(&moment, NULL);
  }
}

/* Closes the socket, so that the process ends, and kills it if it does not. Reports how it ended. */
static void end_process(model *m, char *how, size_t size) {
  int status;
  if (m->socket >= 0) {
    shutdown(m->socket, SHUT_RDWR); /* ends the connection even if a fork of the importer holds a copy of the socket */
    close(m->socket);
    m->socket = -1;
  }
  if (m->process <= 0) return;
  if (!wait_for_end(m->process, END_TIME_MS, &status)) {
    kill(m->process, SIGKILL);
    wait_for_end(m->process, END_TIME_MS, &status);
  }
  m->process = 0;
  if (WIFSIGNALED(status)) snprintf(how, size, "was ended by signal %d", WTERMSIG(status));
  else snprintf(how, size, "ended with exit code %d", WEXITSTATUS(status));
}

/* Reads the whole answer to a request into m->answer; returns MODEL_FATAL and reports a sentence when the process is gone. */
static int receive(model *m) {
  char how[64] = "is gone", sentence[MODEL_TEXT];
  ssize_t size;
  do size = m->socket < 0 ? 0 : recv(m->socket, &m->answer, sizeof m->answer, 0);
  while (size < 0 && errno == EINTR);
  if (size == (ssize_t)sizeof m->answer) {
    m->answer.sentence[MODEL_TEXT - 1] = 0;
    if (m->answer.sentence[0]) m->say(m->importer, (int)m->answer.status, m->answer.sentence);
    return (int)m->answer.status;
  }
  if (size > 0) snprintf(how, sizeof how, "uses another protocol");
  else end_process(m, how, sizeof how);
  snprintf(sentence, sizeof sentence, "the rig's process %s; it is started as '%.300s -m rig_nodes.runs.fmu.rig_process', set "
           "RIG_FMU_PYTHON and RIG_FMU_PATH when these are not the rig's Python and the folder of rig_nodes", how, m->python);
  return fail(m, MODEL_FATAL, sentence);
}

static void tell(model *m, uint32_t what, unsigned samples) {
  m->request.what = what;
  m->request.samples = samples;
  m->request.values = *m->values;
  if (m->socket >= 0) send(m->socket, &m->request, sizeof m->request, MSG_NOSIGNAL); /* reading the answer reports a failure */
}

static int ask(model *m, uint32_t what, unsigned samples) {
  int status;
  tell(m, what, samples);
  status = receive(m);
  if (status <= MODEL_DISCARD) *m->values = m->answer.values;
  return status;
}

/* Returns the importer's environment without the variables of its own Python, and with the path of the rig's. */
static char **environment(const char *path) {
  static const char *const foreign[] = {"PYTHONPATH=", "PYTHONHOME=", "PYTHONSTARTUP="};
  size_t count = 0, kept = 0;
  char **list, *line;
  while (environ[count]) count++;
  list = calloc(count + 2, sizeof *list);
  line = malloc(strlen(path) + sizeof "PYTHONPATH=");
  if (!list || !line) {
    free(list);
    free(line);
    return NULL;
  }
  sprintf(line, "PYTHONPATH=%s", path);
  list[kept++] = line;
  for (size_t k = 0; k < count; k++) {
    int is_foreign = 0;
    for (size_t f = 0; f < sizeof foreign / sizeof *foreign; f++)
      is_foreign |= strncmp(environ[k], foreign[f], strlen(foreign[f])) == 0;
    if (!is_foreign) list[kept++] = environ[k];
  }
  return list;
}

static int start(model *m, const char *path, const char *resources, int theirs) {
  char end_number[16];
  char *const arguments[] = {m->python, "-P", "-m", "rig_nodes.runs.fmu.rig_process", end_number, (char *)resources, NULL};
  char **variables = environment(path);
  posix_spawn_file_actions_t actions;
  posix_spawnattr_t attributes;
  sigset_t none, defaults;
  int error;
  if (!variables) return ENOMEM;
  snprintf(end_number, sizeof end_number, "%d", CHILD_END);
  sigemptyset(&none);
  sigemptyset(&defaults);
  sigaddset(&defaults, SIGINT);
  sigaddset(&defaults, SIGTERM);
  sigaddset(&defaults, SIGPIPE);
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, 2, 1); /* its output must not mix with the importer's */
  posix_spawn_file_actions_adddup2(&actions, theirs, CHILD_END);
  posix_spawnattr_init(&attributes);
  /* a process group of its own, so that Ctrl-C reaches the importer only */
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &defaults);
  error = posix_spawnp(&m->process, m->python, &actions, &attributes, arguments, variables);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  free(variables[0]);
  free(variables);
  return error;
}

/* Returns a copy of a descriptor that is closed on exec and differs from the number that the child uses. */
static int out_of_the_way(int descriptor) {
  const int moved = fcntl(descriptor, F_DUPFD_CLOEXEC, CHILD_END + 1);
  close(descriptor);
  return moved;
}

model *model_new(const char *resources, model_values *values, model_say say, void *importer) {
  char path[PATH_SIZE], name[PATH_SIZE + 16], sentence[MODEL_TEXT];
  const char *other;
  int ends[2], error;
  FILE *file;
  model *m = calloc(1, sizeof *m);
  if (!m) return NULL;
  m->values = values;
  m->say = say;
  m->importer = importer;
  m->socket = -1;
  snprintf(name, sizeof name, "%.4000s/tool.txt", resources);
  file = fopen(name, "re");
  read_line(file, m->python);
  read_line(file, path);
  if (file) fclose(file);
  if ((other = getenv("RIG_FMU_PYTHON")) && *other) snprintf(m->python, sizeof m->python, "%s", other);
  if ((other = getenv("RIG_FMU_PATH")) && *other) snprintf(path, sizeof path, "%s", other);
  if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0) {
    fail(m, MODEL_ERROR, "no socket pair can be made for the rig's process");
    free(m);
    return NULL;
  }
  m->socket = out_of_the_way(ends[0]);
  ends[1] = out_of_the_way(ends[1]);
  error = m->python[0] ? start(m, path, resources, ends[1]) : ENOENT;
  close(ends[1]);
  if (error) {
    snprintf(sentence, sizeof sentence, "the rig's Python '%.300s' does not start (%s); set RIG_FMU_PYTHON to the one "
             "of the rig's environment", m->python, strerror(error));
    fail(m, MODEL_FATAL, sentence);
    m->process = 0;
  }
  if (error || receive(m) > MODEL_WARNING) {
    model_free(m);
    return NULL;
  }
  return m;
}

int model_initialize(model *m) { return ask(m, INITIALIZE, 0); }

int model_step(model *m, unsigned long sample, unsigned samples, unsigned *done) {
  int status;
  (void)sample; /* the rig counts the samples itself */
  status = ask(m, STEP, samples);
  if (status <= MODEL_DISCARD) *done = m->answer.samples;
  return status;
}

int model_terminate(model *m) { return ask(m, TERMINATE, 0); }
int model_reset(model *m) { return ask(m, RESET, 0); }

int model_save(model *m, unsigned char **bytes, size_t *size) {
  int status = ask(m, SAVE, 0);
  size_t got = 0;
  *bytes = NULL;
  *size = status <= MODEL_WARNING ? m->answer.samples : 0;
  if (!*size) return status;
  *bytes = malloc(*size);
  while (*bytes && got < *size) {
    const ssize_t part = recv(m->socket, *bytes + got, *size - got, 0);
    if (part > 0) got += (size_t)part;
    else if (part == 0 || errno != EINTR) break;
  }
  if (got == *size) return status;
  free(*bytes);
  *bytes = NULL;
  return fail(m, MODEL_FATAL, "the rig's process ended while its state was saved");
}

int model_restore(model *m, const unsigned char *bytes, size_t size) {
  tell(m, RESTORE, (unsigned)size);
  for (size_t sent = 0; m->socket >= 0 && sent < size;) {
    const ssize_t part = send(m->socket, bytes + sent, size - sent < PIECE ? size - sent : PIECE, MSG_NOSIGNAL);
    if (part > 0) sent += (size_t)part;
    else if (part == 0 || errno != EINTR) break; /* reading the answer reports a failure */
  }
  return receive(m);
}

void model_free(model *m) {
  char how[64];
  if (!m) return;
  end_process(m, how, sizeof how);
  free(m);
}
