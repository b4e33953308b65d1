# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Analysis of recorded runs: shift metrics by the laboratory's definitions, energy balance, report.

It works on arrays and bags. The command line, the tests and Python scripts that open a bag use it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
