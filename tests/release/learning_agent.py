# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks the environment with the checker of stable-baselines3, and lets its PPO take some steps (README.md beside it)."""

import gymnasium
from gymnasium.wrappers import RescaleAction
from stable_baselines3 import PPO
from stable_baselines3.common.env_checker import check_env

import rig_nodes  # noqa: F401, it registers the environment

for actions in ("currents", "profile"):
    env = gymnasium.make("rig_nodes/Shift-v0", actions=actions)
    check_env(env, warn=True)
    scaled = RescaleAction(env, -1.0, 1.0)
    PPO("MlpPolicy", scaled, n_steps=64, batch_size=32).learn(128)
    print(f"{actions}: check_env passed, PPO took 128 steps")
