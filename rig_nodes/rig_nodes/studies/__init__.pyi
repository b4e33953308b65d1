# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

# The names of this room that others use; __init__.py finds each in its module when it is asked for.

from .benchmark.document import TITLES as TITLES, lines as lines, machine_line as machine_line
from .benchmark.growth import bench_scaling as bench_scaling
from .benchmark.kernel import bench_kernel as bench_kernel
from .benchmark.machine import machine as machine
from .benchmark.peers import bench_peers as bench_peers
from .benchmark.rigs import bench_rigs as bench_rigs
from .benchmark.starts import bench_demo as bench_demo, bench_graph as bench_graph
from .benchmark.step_cost import controllers_table as controllers_table
from .faults.cases import Course as Course
from .faults.score import bench_faults as bench_faults, lines_of_faults as lines_of_faults
from .sweep.cluster import dask_stream as dask_stream
from .sweep.plan import Plan as Plan, Varied as Varied, make_plan as make_plan, plan_of as plan_of, plugged_of as plugged_of, read_plan as read_plan
from .sweep.run import forget_unfinished as forget_unfinished, manifest_of as manifest_of, run_sweep as run_sweep
from .sweep.store import RESULTS as RESULTS, SWEEP as SWEEP, SWEEP_JOURNAL as SWEEP_JOURNAL, Store as Store, begun as begun, column_of as column_of, decode as decode, open_journal as open_journal, parquet as parquet, read_manifest as read_manifest, rows_of as rows_of
from .tune.beginning import read_beginnings as read_beginnings
from .tune.folder import controller_yaml as controller_yaml, TUNING as TUNING, TUNING_JOURNAL as TUNING_JOURNAL
from .tune.problem import OBJECTIVES as OBJECTIVES, Range as Range
from .tune.run import Problem as Problem, run_tuning as run_tuning, tuning_text as tuning_text
from .tune.search import load_optuna as load_optuna
from .tune.space import BOUNDS as BOUNDS, delay_of as delay_of, settings as settings, values_of as values_of
from .tune.uncertainty import calibration_for as calibration_for, read_spreads as read_spreads, spreads_of as spreads_of
from .validation.calibrate import Calibration as Calibration, Found as Found, Miss as Miss, Parameter as Parameter, UNSHIFTED as UNSHIFTED, at_shares as at_shares, calibrate as calibrate, load_stages as load_stages, nearby as nearby, shares_of as shares_of, write_values as write_values
from .validation.own_calibration import calibration_of as calibration_of
from .validation.own_rows import check_settings as check_settings, chosen_rows as chosen_rows, load_rows as load_rows, rows_by_run as rows_by_run, validate_rows as validate_rows
from .validation.rows import INSIDE as INSIDE, Judged as Judged, NOT_COMPARED as NOT_COMPARED, OUTSIDE as OUTSIDE, Row as Row, Span as Span, Target as Target, listed as listed
from .validation.tables import accepted as accepted, counts as counts, laboratory as laboratory, of_rig as of_rig, terminal as terminal, verdict_line as verdict_line
from .validation.which_rows import CALIBRATION_FILE as CALIBRATION_FILE, ROWS_FILE as ROWS_FILE, programme_of as programme_of, rows_file as rows_file
