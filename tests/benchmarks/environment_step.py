# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Time of a step of the learning environment, ten samples of 1 ms, and of the same samples of the rig alone.

.venv/bin/python tests/benchmarks/environment_step.py

Both make the same episodes in turn, so that they meet the same load of the machine.
"""

import time

import gymnasium
import numpy as np

import rig_nodes  # noqa: F401, it registers the environment

EPISODES, STEPS = 30, 140
ACTION = np.array([0.74, 0.0])  # gear I is held


def episode(env: gymnasium.Env, alone: bool) -> list[float]:
    """Returns the time of each step of an episode [us], of the environment or of the rig alone."""
    env.reset(seed=1)
    rig, times = env.unwrapped.session.rig, []
    for _ in range(STEPS):
        if alone:
            rig.set_current(rig.sample, (*ACTION.tolist(), 0.0), 2, False)
            began = time.perf_counter()
            rig.advance_samples(10)
        else:
            began = time.perf_counter()
            env.step(ACTION)
        times.append(1e6 * (time.perf_counter() - began))
    return times


def main() -> None:
    made = gymnasium.make("rig_nodes/Shift-v0")
    found: dict[str, list[float]] = {"rig alone": [], "environment": [], "as gymnasium.make wraps it": []}
    for _ in range(EPISODES):
        for name, env in zip(found, (made, made.unwrapped, made)):
            found[name] += episode(env, name == "rig alone")
    for name, times in found.items():
        print(f"{name}: median {np.median(times):.1f} us, lowest tenth {np.quantile(times, 0.1):.1f} us")


if __name__ == "__main__":
    main()
