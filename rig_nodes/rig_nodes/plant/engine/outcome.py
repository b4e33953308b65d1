# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""How a call of a compiled entry ended; set by plant.engine.loop, read by runs.rig_base.

WHOLE: all samples are done. NOT_FINITE, NOT_SETTLED: the call stopped after the sample in which a value was not a finite number,
or in which the friction of a step did not settle. WARNED, TRIPPED: it stopped after a sample in which a trip gave its warning, or
in which one fired.
"""

WHOLE, NOT_FINITE, NOT_SETTLED, WARNED, TRIPPED = range(5)
