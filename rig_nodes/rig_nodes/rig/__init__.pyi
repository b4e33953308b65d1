# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

# The names of this room that others use; __init__.py finds each in its module when it is asked for.

from .alfa46 import Alfa46Config as Alfa46Config, Alfa46Values as Alfa46Values, OUTPUT_KEYS as OUTPUT_KEYS, POINTS as POINTS, beyond_alfa46 as beyond_alfa46, check_gains as check_gains, check_profile as check_profile, read_alfa46 as read_alfa46
from .settings_changed import changed_settings as changed_settings
from .bench_trips import BAD_CONTROLLER as BAD_CONTROLLER, ENDED_EARLY as ENDED_EARLY, NO_ANSWER as NO_ANSWER, NO_COMMAND as NO_COMMAND, NO_NUMBER as NO_NUMBER, PROCESS_LOST as PROCESS_LOST, RED_BUTTON as RED_BUTTON, RESET_EVENT as RESET_EVENT, STATUS as STATUS, STOOD_STILL as STOOD_STILL, TRIPPED as TRIPPED, UNSETTLED as UNSETTLED, WARNING as WARNING, bench_trips as bench_trips, trips_named as trips_named
from .commands import Setpoint as Setpoint
from .configuration import RigConfig as RigConfig, check_gearbox as check_gearbox, load_gearbox_rig as load_gearbox_rig, load_rig as load_rig, rig_name as rig_name, with_overrides as with_overrides
from .cross_checks import cross_check as cross_check
from .driveline import bodies_shown as bodies_shown, build_driveline as build_driveline, inertias_of as inertias_of, inputs_of as inputs_of, owns_shaft as owns_shaft, shaft_of as shaft_of
from .effects import leave_out as leave_out
from .picture import driveline_drawn as driveline_drawn, driveline_svg as driveline_svg
from .faults import FAULTS as FAULTS, FAULTS_APART as FAULTS_APART, FAULT_OFF as FAULT_OFF, FAULT_ON as FAULT_ON, FAULT_ORDERED as FAULT_ORDERED, FaultOfRig as FaultOfRig, FaultOrder as FaultOrder, check_enabled as check_enabled, faults_of as faults_of, orders_by_name as orders_by_name, read_fault as read_fault, shown_unit as shown_unit
from .quantities import DIMENSIONS as DIMENSIONS, QUANTITIES as QUANTITIES
from .read import CLUTCHES as CLUTCHES
from .recorded_rig import config_of_record as config_of_record
from .reference import page as page, rows_of_parts as rows_of_parts
from .settings import CHANGED as CHANGED, CONTROLLER as CONTROLLER, OWN as OWN, POINT as POINT, Setting as Setting, Settings as Settings, own_setting as own_setting, settings_of as settings_of
from .signal_catalogue import Catalogue as Catalogue, Offer as Offer, QOS as QOS, Signal as Signal, Topic as Topic, catalogue as catalogue, installed_topics as installed_topics
from .signals import CONTROLLER_COMMAND as CONTROLLER_COMMAND, CONTROLLER_EVENTS as CONTROLLER_EVENTS, CONTROLLER_FAILED as CONTROLLER_FAILED, CONTROLLER_SILENT as CONTROLLER_SILENT, GEAR_WAS as GEAR_WAS, SHIFT_ORDERED as SHIFT_ORDERED, TORQUES as TORQUES, absolute_pressures as absolute_pressures, torque_signals as torque_signals
from .structure import Device as Device, End as End, OwnPlot as OwnPlot, RATE as RATE, Structure as Structure, Transducer as Transducer, structure_of as structure_of
from .transducer_types import TRANSDUCER_TYPES as TRANSDUCER_TYPES, measured_range as measured_range
from .trip import GEAR as GEAR, MEASURED as MEASURED, SHIFTING as SHIFTING, STAYED as STAYED, Sum as Sum, Trip as Trip
from .trips import TRIPS as TRIPS, WATCHED as WATCHED
from .transmission import Clutch as Clutch, Inertias as Inertias, NEUTRAL as NEUTRAL, Shift as Shift, Transmission as Transmission, ranges_of as ranges_of, slip_of as slip_of, transmission_of as transmission_of
