# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A rig as its folder describes it: what it is made of, what each device is joined to, which signals it has.

rig.configuration reads it; the engine's plan, the transmission, the signal catalogue and the controller's record are
made from it. No rig is named in this code.
"""
