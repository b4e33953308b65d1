# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Torque and drag of wet multi-plate clutches by chapter 6 of the thesis; it can be used alone from Python.

``geometry``: ring and splines of a pack; ``closed``: torque of plates in contact; ``drag``: torque of oil between slipping
plates; ``bench``: the clamp force of chapter 8.
plant.parts.plates takes its torque and its drag from here.
"""
