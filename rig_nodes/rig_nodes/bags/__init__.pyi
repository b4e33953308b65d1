# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

# The names of this room that others use; __init__.py finds each in its module when it is asked for.

from . import cdr as cdr, limits as limits
from .canonical import canonical_hash as canonical_hash
from .cdr import Fields as Fields, Form as Form, encoder as encoder, stamp as stamp
from .copy import Kept as Kept, check as check, content_hash as content_hash, count as count, describe as describe, left_out as left_out, write as write
from .definitions import installed as installed, parse as parse
from .exchange.cells import CellError as CellError
from .exchange.files import FILE_KINDS as FILE_KINDS, Order as Order, arrow_schema as arrow_schema, arrow_table as arrow_table, export as export, started as started, whole as whole
from .exchange.foreign import read_foreign as read_foreign
from .exchange.formats.format import is_loggers_file as is_loggers_file
from .exchange.groups import DESCRIBING as DESCRIBING, IN_MEMORY as IN_MEMORY, Rows as Rows, Signals as Signals, on_one_clock as on_one_clock, on_own_clocks as on_own_clocks
from .exchange.imported import Measurement as Measurement, NO_RIG as NO_RIG, read_measurement as read_measurement, why_none as why_none, sequence_name as sequence_name, write_bag as write_bag
from .exchange.orders import example_of_orders as example_of_orders
from .exchange.profile import Profile as Profile, read_profile as read_profile, time_above_0 as time_above_0
from .exchange.propose import proposed as proposed
from .exchange.provenance import csvw_path as csvw_path
from .index import HOLE as HOLE
from .logged import Logged as Logged, Recording as Recording, orders_in as orders_in
from .mcap_file import not_sqlite as not_sqlite
from .messages import NOTHING as NOTHING, in_short as in_short, nothing_in as nothing_in, recovered as recovered
from .metadata import OFFERED as OFFERED, offered_by as offered_by, profiles_of_today as profiles_of_today
from .old_form import topic_of_today as topic_of_today
from .opened import OpenedBags as OpenedBags
from .pieces import PIECE as PIECE, files_of_run as files_of_run, read_metadata as read_metadata
from .player import CLOCK as CLOCK, Played as Played, Player as Player
from .reader import Bag as Bag, Logger as Logger, UNREADABLE as UNREADABLE
from .recording import BagRecording as BagRecording
from .rig_in_bag import holds_rig as holds_rig, rig_record as rig_record
from .run_end import CUT_OFF as CUT_OFF, NO_REPORT as NO_REPORT, RunEnd as RunEnd, STATE as STATE, STOPPED as STOPPED, faults_of as faults_of, with_end as with_end
from .sequence_numbers import LIFE_BITS as LIFE_BITS, Numbers as Numbers
from .writer import BagWriter as BagWriter, Column as Column, LIBRARY_OF_RUN as LIBRARY_OF_RUN, Layout as Layout
