# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

# The names of this room that others use; __init__.py finds each in its module when it is asked for.

from .live_view import LiveSession as LiveSession
from .panel.own_rig import OwnRig as OwnRig
from .panel.server import PanelServer as PanelServer, listening as listening
from .processes.child import start_server as start_server
from .processes.dropping import parse_drop as parse_drop
from .processes.recording_options import TopicChoice as TopicChoice, add_options as add_options, words as words
from .processes.result import end_of as end_of, facts_of as facts_of, join_pieces as join_pieces, lost_messages as lost_messages, open_bag as open_bag, run_part as run_part
from .processes.supervisor import End as End, MODULES as MODULES, Order as Order, Supervisor as Supervisor, processes_of as processes_of
from .qos import read_overrides as read_overrides
from .replay import CLOCK_TOPIC as CLOCK_TOPIC, Outcome as Outcome, ReplaySession as ReplaySession, latched as latched, obstacle as obstacle, offered as offered
from .ros_arguments import own_arguments as own_arguments
from .running_rig import RunningRig as RunningRig
