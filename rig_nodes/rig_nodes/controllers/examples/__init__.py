# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reference controllers: the Alfa46 law as Python class and as C library, to copy from and to test plugs."""
