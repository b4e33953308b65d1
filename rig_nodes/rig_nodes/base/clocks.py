# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The division of time, which is the same for every rig: controller sample, graph tick, logger row, and the age that trips.

All that counts time in these units uses it; docs/background/graph.md states the purpose of each.
"""

SAMPLE_NS = 1_000_000  # controller sample; commands apply on its boundaries
SAMPLE = 1e-3  # s, the same
TICK_SAMPLES = 5  # controller samples per graph tick
ROW = 1e-4  # s: rows of a logger of 10 kHz, as the laboratory's, by which shifts are measured where no bag is written
COMMAND_TIMEOUT = 0.1  # s: a command older than this, simulated or, in real time, of wall clock, counts as silence
MOST_DELAY = round(0.5 * COMMAND_TIMEOUT / SAMPLE)  # samples that a controller's answer may be kept for
