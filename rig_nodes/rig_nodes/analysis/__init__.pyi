# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

# The names of this room that others use; __init__.py finds each in its module when it is asked for.

from . import modes as modes
from .annex_a import FACTOR_B as FACTOR_B
from .causes import SWING as SWING, TIED as TIED
from .clutch_torques import lever_of as lever_of
from .coasting import coast_down as coast_down
from .compare_tables import clock_lines as clock_lines, metric_tables as metric_tables, reasons as reasons, signal_tables as signal_tables
from .definitions import BEFORE as BEFORE, K_MOST as K_MOST, LONGEST as LONGEST, NO_SEQUENCE as NO_SEQUENCE, PRESSURE_MEAN as PRESSURE_MEAN, RPM as RPM, TORQUE_SPEED_MEAN as TORQUE_SPEED_MEAN, undefined_lines as undefined_lines
from .course import LEAST_TORQUE as LEAST_TORQUE, asked_of_input as asked_of_input
from .detuning import Detuned as Detuned, Detuning as Detuning, detune as detune, detuning_file as detuning_file, read_detuning as read_detuning
from .display import aligned as aligned, fixed as fixed, in_unit as in_unit, shown as shown
from .edges import first_true as first_true, odd_width as odd_width, ramp_start as ramp_start, running_mean as running_mean
from .energy import clutch_heat as clutch_heat, energy_names as energy_names
from .engagement import HOLD_SHORTEST as HOLD_SHORTEST, engagement_metrics as engagement_metrics, engagement_ranks as engagement_ranks
from .faults import faults_at as faults_at
from .gathered import Gathered as Gathered, SMALL as SMALL
from .limits import Limit as Limit, MET as MET, MISSED as MISSED, NOT_FOUND as NOT_FOUND, UNDECIDED as UNDECIDED, counted as counted, judged as judged, limit_lines as limit_lines, parse_limits as parse_limits, range_text as range_text, read_limits as read_limits
from .loops import STEP as STEP, loop_columns as loop_columns, put_loops as put_loops
from .lost import what_was_lost as what_was_lost
from .measured_error import Instrument as Instrument, instruments_of as instruments_of, uncertainty as uncertainty
from .metrics import Metric as Metric, PLOTS as PLOTS, SHORT as SHORT, every_metric as every_metric, metric_keys as metric_keys, named_metrics as named_metrics
from .modes import Critical as Critical, Found as Found, Response as Response, Spectrum as Spectrum, beside as beside, found_in as found_in, recorded as recorded, spectrum as spectrum, states_of as states_of, system_of as system_of
from .moved import moved_lines as moved_lines
from .no_change import measured_lines as measured_lines
from .of_runs import gather as gather, gathering as gathering, source_of as source_of
from .peak import sentence_of_peak as sentence_of_peak
from .phases import FILL as FILL, INERTIA as INERTIA, INTERRUPTED as INTERRUPTED, Part as Part, TORQUE as TORQUE, moments_of as moments_of, phases_of as phases_of, times_of as times_of
from .plate_heat import above_the_oil as above_the_oil
from .press_bench import OF_A_RUN as OF_A_RUN, bench_lines as bench_lines, of_press as of_press
from .quality import FAILED as FAILED, bounds_of as bounds_of, GRADES as GRADES, POOR as POOR, quality_of as quality_of, sentence_of as sentence_of
from .ranges import LOGGER as LOGGER, range_cells as range_cells
from .report_text import format_report as format_report, no_shift as no_shift, not_accounted as not_accounted, numbered_way as numbered_way, shift_name as shift_name
from .results import ENDS as ENDS, Result as Result, number as number, results_of as results_of, results_of_shift as results_of_shift, spread as spread, spread_cells as spread_cells, spread_lines as spread_lines
from .run_report import REPORT_FILE as REPORT_FILE, build_report as build_report, info_of as info_of, is_of as is_of, plain as plain, read_report as read_report, shown_transmission as shown_transmission, verdicts_in as verdicts_in, write_report as write_report
from .run_settings import settings_of_run as settings_of_run
from .runs_table import Member as Member, judged_members as judged_members, member_of as member_of, members_in as members_in, named_shifts as named_shifts, read_procedure as read_procedure, table_of as table_of, warnings_of as warnings_of, write_procedure as write_procedure
from .shift import shift_metrics as shift_metrics, shifts as shifts, with_ends as with_ends, without_slip as without_slip
from .side_by_side import Comparison as Comparison, ShiftCurves as ShiftCurves, Source as Source, compare as compare, short_names as short_names
from .slip_bench import MODELS as MODELS, cylinder_line as cylinder_line, ring_area as ring_area, slip_line as slip_line, slip_tests as slip_tests, spring_line as spring_line
from .state_at_order import Moment as Moment, begun_lines as begun_lines, flat as flat, put_known as put_known, unit_of as unit_of, unlike as unlike
from .trips import trip_lines as trip_lines, without_trips as without_trips
from .valve_response import valve_delay as valve_delay
