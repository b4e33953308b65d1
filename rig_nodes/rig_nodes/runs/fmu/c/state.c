/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* The state of an instance, for both versions of FMI: saved, brought back, and as bytes that another process reads.
 *
 * A state is a head and the bytes of the model behind it, without a pointer, so its bytes are what is serialized.
 */
#include "model.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

static const char MAGIC[8] = "rig-fmu";

typedef struct {
  char magic[8];
  uint64_t checksum; /* of everything behind it */
  char token[64];
  uint64_t size;     /* of the head and the model's bytes */
  model_values values;
  double start, stop;
  uint64_t sample;
  int32_t phase, fresh;
} state_head;

struct instance_state {
  state_head head;
  unsigned char model[];
};

/* Returns FNV-1a, 64 bits, over what lies behind the checksum. */
static uint64_t checksum_of(const instance_state *state) {
  const size_t first = offsetof(state_head, token);
  const unsigned char *bytes = (const unsigned char *)state;
  uint64_t sum = 0xcbf29ce484222325u;
  for (size_t k = first; k < state->head.size; k++) sum = (sum ^ bytes[k]) * 0x100000001b3u;
  return sum;
}

/* Refuses a state that is none, or one of another FMU. */
static int check(instance *i, const instance_state *state) {
  if (!state || memcmp(state->head.magic, MAGIC, sizeof MAGIC) != 0)
    return instance_refuse(i, MODEL_ERROR, "this is no saved state of an FMU of rig_nodes");
  if (strncmp(state->head.token, MODEL_TOKEN, sizeof state->head.token) != 0)
    return instance_refuse(i, MODEL_ERROR, "the state is that of another FMU, or of another version of this one, with the token %.63s",
                           state->head.token);
  return MODEL_OK;
}

int instance_save(instance *i, instance_state **state) {
  unsigned char *bytes = NULL;
  size_t size = 0;
  instance_state *saved;
  int status;
  if (i->phase == DEAD) return MODEL_FATAL;
  if (!state) return instance_refuse(i, MODEL_ERROR, "there is no place for the state");
  status = model_save(i->model, &bytes, &size);
  if (status == MODEL_FATAL) i->phase = DEAD;
  if (status > MODEL_WARNING) return status;
  saved = calloc(1, sizeof *saved + size); /* zeros, so that equal states have equal bytes */
  if (!saved) {
    free(bytes);
    return instance_refuse(i, MODEL_ERROR, "there is no memory for the state");
  }
  memcpy(saved->head.magic, MAGIC, sizeof MAGIC);
  strncpy(saved->head.token, MODEL_TOKEN, sizeof saved->head.token - 1);
  saved->head.size = sizeof *saved + size;
  saved->head.values = i->values;
  saved->head.start = i->start;
  saved->head.stop = i->stop;
  saved->head.sample = i->sample;
  saved->head.phase = i->phase;
  saved->head.fresh = i->fresh;
  if (size) memcpy(saved->model, bytes, size);
  saved->head.checksum = checksum_of(saved);
  free(bytes);
  free(*state);
  *state = saved;
  return MODEL_OK;
}

int instance_restore(instance *i, const instance_state *state) {
  int status;
  if (i->phase == DEAD) return MODEL_FATAL;
  status = check(i, state);
  if (status != MODEL_OK) return status;
  i->values = state->head.values;
  status = instance_after(i, model_restore(i->model, state->model, state->head.size - sizeof *state));
  if (status > MODEL_WARNING) return status;
  i->values = state->head.values; /* a model that began anew has written its first outputs */
  i->start = state->head.start;
  i->stop = state->head.stop;
  i->sample = state->head.sample;
  i->phase = (model_phase)state->head.phase;
  i->fresh = state->head.fresh;
  return MODEL_OK;
}

int instance_state_size(instance *i, const instance_state *state, size_t *size) {
  const int status = i->phase == DEAD ? MODEL_FATAL : check(i, state);
  if (status == MODEL_OK) *size = state->head.size;
  return status;
}

int instance_serialize(instance *i, const instance_state *state, unsigned char *bytes, size_t size) {
  const int status = i->phase == DEAD ? MODEL_FATAL : check(i, state);
  if (status != MODEL_OK) return status;
  if (!bytes || size < state->head.size)
    return instance_refuse(i, MODEL_ERROR, "there are %zu bytes for the state, which takes %zu", bytes ? size : 0,
                           (size_t)state->head.size);
  memcpy(bytes, state, state->head.size);
  return MODEL_OK;
}

int instance_deserialize(instance *i, const unsigned char *bytes, size_t size, instance_state **state) {
  instance_state *read;
  int status;
  if (i->phase == DEAD) return MODEL_FATAL;
  if (!state) return instance_refuse(i, MODEL_ERROR, "there is no place for the state");
  if (!bytes || size < sizeof *read) return instance_refuse(i, MODEL_ERROR, "%zu bytes are no saved state of this FMU", size);
  read = malloc(size);
  if (!read) return instance_refuse(i, MODEL_ERROR, "there is no memory for the state");
  memcpy(read, bytes, size);
  read->head.token[sizeof read->head.token - 1] = 0;
  status = check(i, read);
  if (status == MODEL_OK && read->head.size != size)
    status = instance_refuse(i, MODEL_ERROR, "the state has %zu bytes, expected %zu", size, (size_t)read->head.size);
  if (status == MODEL_OK && (read->head.checksum != checksum_of(read) || read->head.phase < INSTANTIATED || read->head.phase >= DEAD))
    status = instance_refuse(i, MODEL_ERROR, "the state is damaged: its checksum is not that of its bytes");
  if (status != MODEL_OK) {
    free(read);
    return status;
  }
  free(*state);
  *state = read;
  return MODEL_OK;
}
