# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recording: exact CDR messages, MCAP bags that rosbag2 reads, and the reader for reports and views.

Used by the publishers, the recorder, the headless run, the analysis and the view; needs no running ROS.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
