# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""FMUs: the rig as one, and shift controllers of rig_controller.h as one; the plug that runs them is controllers.fmi.plug.

`rig export` and users' own programs call build.py; the code inside the FMU is C (c/), the rig behind it is
rig_process.py.
"""
