# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names for types of arrays, used in annotations only; docstrings state the shapes and units."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Ints: TypeAlias = npt.NDArray[np.int64]
Record: TypeAlias = npt.NDArray[np.void]  # a structured array, or one of its rows as compiled code sees it
