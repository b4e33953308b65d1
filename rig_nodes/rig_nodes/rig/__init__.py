# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A rig as its folder describes it: what it is made of, what each device is joined to, which signals it has.

rig.configuration reads it; the engine's plan, the transmission, the signal catalogue and the controller's record are
made from it. No rig is named in this code.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
