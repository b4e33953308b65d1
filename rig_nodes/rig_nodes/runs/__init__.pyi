# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

# The names of this room that others use; __init__.py finds each in its module when it is asked for.

from .bag_outputs import BagOutputs as BagOutputs
from .calculations import Calculation as Calculation, Recorded as Recorded, Table as Table, calculations_of as calculations_of, of_bag as of_bag, on_recording as on_recording, recorded_with as recorded_with
from .campaign import run_campaign as run_campaign
from .can_log import export_can_log as export_can_log
from .commanded_rig import check_level as check_level
from .conformance import Check as Check
from .cuts import topic_of as topic_of
from .fmu.build import build_controller_fmu as build_controller_fmu, build_rig_fmu as build_rig_fmu
from .fault_check import BADLY as BADLY, FAILED as FAILED, HARM as HARM, IN_TIME as IN_TIME, WELL as WELL, WORSE as WORSE, check_under_faults as check_under_faults
from .folders import pairs as pairs, parse_parameters as parse_parameters, parse_settings as parse_settings, run_folder as run_folder, unless_empty as unless_empty
from .moments import Present as Present
from .outputs import Outputs as Outputs, SCALAR_SAMPLES as SCALAR_SAMPLES
from .plan import plan_of as plan_of
from .procedure import Procedure as Procedure, Series as Series, load_procedure as load_procedure, prepare as prepare, run_repeat as run_repeat
from .python_sequence import sequence_of as sequence_of
from .recorded import CHUNK as CHUNK, Rows as Rows, Run as Run, moment_of as moment_of, record as record
from .rerun import Answers as Answers, check_whole as check_whole, different_topics as different_topics, rerun_controller as rerun_controller, rerun_plant as rerun_plant
from .rig import Rig as Rig
from .rig_base import RigStatus as RigStatus
from .run_file import Ordered as Ordered, read_run as read_run, write_run as write_run
from .sequence import BY_HAND as BY_HAND, Sequence as Sequence, load_sequence as load_sequence
from .sequence_runner import SequenceFailed as SequenceFailed, SequenceRunner as SequenceRunner
from .simulation import check_controller as check_controller, check_delay as check_delay, give_answer as give_answer, run_record as run_record, simulate as simulate
from .session import ORDER as ORDER, Session as Session
from .snapshot import Snapshot as Snapshot
from .trips import FOLLOWING as FOLLOWING, Tripped as Tripped, trips_without_limits as trips_without_limits
from .workers import Lost as Lost, RIGS_PRELOADED as RIGS_PRELOADED, Workers as Workers, start_server as start_server
