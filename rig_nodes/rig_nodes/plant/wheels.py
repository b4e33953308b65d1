# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The teeth of the gearbox's wheels (thesis tab. 3.2), and where its clutches sit on them.

Used by testbench.gearbox_plan, which builds the driveline, and by transmission, which takes the ratios of the gears from it.
"""

Z1, Z2, Z3, Z4, Z5, Z7, Z8 = 34, 33, 47, 41, 40, 37, 41
INPUT, OUTPUT = "w0", "wk"
# clutch -> speed of its driving side by that of w0, of its driven side by that of wk, (6.87)-(6.92)
SIDES = {"S1": (Z1 / Z3, Z8 / Z4), "S2": (1.0, Z8 / Z5)}
REDUCTION = Z8 / Z5  # speed of z5, on which the output's inertia is given, by that of wk
