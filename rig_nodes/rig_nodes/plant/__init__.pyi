# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

# The names of this room that others use; __init__.py finds each in its module when it is asked for.

from . import alfa46_law as alfa46_law
from .alfa46_law import NEUTRAL as NEUTRAL
from .engine.general_step import Addresses as Addresses, NONE as NONE, addresses as addresses, general_step as general_step
from .engine.loop import GaugeArrays as GaugeArrays, Law as Law, Plant as Plant, Rings as Rings, advance as advance
from .engine.outcome import NOT_SETTLED as NOT_SETTLED, TRIPPED as TRIPPED, WARNED as WARNED, WHOLE as WHOLE
from .engine.outside import Answer as Answer, LOAD as LOAD, MOTOR as MOTOR, NOTHING as NOTHING, NOT_DEVICES as NOT_DEVICES, OtherSide as OtherSide, Port as Port, VALVE as VALVE, check_device as check_device, cuttable as cuttable, drained as drained, why_not as why_not
from .engine.plan import Instance as Instance, Meter as Meter, Plan as Plan, World as World
from .engine.watch import ALL as ALL, BOTH_INSIDE as BOTH_INSIDE, BOTH_SHOWN as BOTH_SHOWN, FIRST_STAY as FIRST_STAY, INSIDE as INSIDE, ONE_SHOWN as ONE_SHOWN, OTHER as OTHER, REPORTED as REPORTED, RESTING as RESTING, SHOWN as SHOWN, TRIP as TRIP, Watch as Watch
from .engine.warm_compile import compiling_in_parallel as compiling_in_parallel
from .engine.world import Sizes as Sizes, beginning as beginning, driveline_dtype as driveline_dtype
from .faults.fault import ERRATIC as ERRATIC, Fault as Fault, GROWING as GROWING, INTERMITTENT as INTERMITTENT, LINES as LINES, LOST as LOST, MEASUREMENTS as MEASUREMENTS, MESSAGES as MESSAGES, ONSETS as ONSETS, OPEN as OPEN, SHORT as SHORT, STUCK as STUCK, Size as Size, TRANSDUCER as TRANSDUCER, faults as faults
from .friction.bench import SPRING_TRAVEL as SPRING_TRAVEL, clamp_force as clamp_force, slip_torques as slip_torques
from .friction.closed import osinski_factor as osinski_factor, thesis as thesis, traditional as traditional
from .friction.geometry import Numbers as Numbers, PackGeometry as PackGeometry
from .instruments.noise import channel_key as channel_key, uniform as uniform
from .instruments.transducers import GAIN as GAIN, GATE as GATE, HIGH as HIGH, HUM as HUM, KEEP as KEEP, LOW as LOW, NOISE as NOISE, OFFSET as OFFSET, PICKUP as PICKUP, QUANTUM as QUANTUM, ROWS as ROWS, STEP as STEP, TURN as TURN, mains as mains, shown_dtype as shown_dtype
from .kiss_point import kiss_pressure as kiss_pressure
from .parts import part as part
from .parts.centrifugal_clutch import CentrifugalConfig as CentrifugalConfig, clutch_torque as clutch_torque
from .parts.combustion_engine import full_torque as full_torque
from .parts.curve_clutch import Force as Force
from .parts.gear_loss import RPM as RPM
from .parts.load_pump import LoadConfig as LoadConfig, load_torque as load_torque, most_torque as most_torque, relief_setting_for as relief_setting_for
from .parts.part import VALUES as VALUES
from .parts.plates import derived_of_pack as derived_of_pack
from .parts.proportional_valve import BY_DUTY as BY_DUTY, BY_LAW as BY_LAW, BY_SETPOINT as BY_SETPOINT
from .parts.sash import GRAVITY as GRAVITY, motion as motion
from .parts.saw_chain import chain_inertia as chain_inertia, chain_mass as chain_mass
from .parts.saw_cutting import depth_of_cut as depth_of_cut, feed_per_tooth as feed_per_tooth, force_per_width as force_per_width
from .parts.twisting_coupling import CouplingConfig as CouplingConfig, geometry as geometry, levers as levers
from .parts.vehicle import road_force as road_force
from .parts.wet_clutch import NO_PRESSURE as NO_PRESSURE
