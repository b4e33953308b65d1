# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

# The names of this room that others use; __init__.py finds each in its module when it is asked for.

from .checks import assert_events as assert_events, assert_never as assert_never, assert_shift as assert_shift, assert_stays as assert_stays
from .benched import bench as bench, bench_faults as bench_faults, measured as measured, parts_of as parts_of
from .calibrated import Calibrated as Calibrated, calibrate as calibrate
from .checked import checked as checked
from .compared import Compared as Compared
from .exported import exported as exported
from .given import seconds_of as seconds_of, whole as whole
from .opened import imported as imported, open as open
from .paged import page_of as page_of
from .procedures import procedure as procedure, procedure_series as procedure_series, run_series as run_series
from .reran import Rerun as Rerun, rerun_into as rerun_into
from .rig import Rig as Rig, load as load
from .run import Run as Run
from .signals import Signal as Signal, Signals as Signals
from .simulated import simulated as simulated
from .swept import run_plan as run_plan, sweep as sweep
from .table import Table as Table
from .tuned import Tuned as Tuned, tune as tune
from .validated import validate as validate, validated as validated
