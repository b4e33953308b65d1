/*
 * Copyright 2026 Virtual rig maintainers
 * SPDX-License-Identifier: Apache-2.0
 */

/* The basic types of generated code, those that the model in this folder uses. Simulink Coder writes its own file. */
#ifndef RTWTYPES_H
#define RTWTYPES_H

#include <stdint.h>

typedef double real_T;
typedef uint8_t uint8_T;
typedef int32_t int32_T;
typedef uint8_T boolean_T;

#endif
