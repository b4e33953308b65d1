# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

# The names of this room that others use; __init__.py finds each in its module when it is asked for.

from . import algebra as algebra, losses as losses
from .algebra import E_FRIC as E_FRIC, E_SHAFT as E_SHAFT, E_VISC as E_VISC, HI0 as HI0, HI1 as HI1, KIN0 as KIN0, KIN1 as KIN1, LAM as LAM, LO0 as LO0, LO1 as LO1, LOCK as LOCK, N_CAPPED as N_CAPPED, N_EVENTS as N_EVENTS, TAU as TAU, VISC as VISC, WORST as WORST, work_size as work_size
from .bends import parts_of_steps as parts_of_steps
from .builder import Driveline as Driveline
from .calls import address_of as address_of, bare_address as bare_address, bare_step as bare_step, call_of as call_of
from .collocation import highest_resolved as highest_resolved
from .driven import driven_arrays as driven_arrays, driven_step as driven_step
from .inputs import Input as Input
from .law_steps import settled_address as settled_address
from .laws import ANGLE as ANGLE, MOTION as MOTION, TORQUE as TORQUE, stored_energy as stored_energy
from .losses import BASE as BASE, FACTOR as FACTOR, ON as ON, OWN as OWN, loss_width as loss_width
from .picture import Body as Body, Link as Link, columns as columns, svg as svg
from .quick import quick_address as quick_address, quick_types as quick_types
from .quiet import quiet_step as quiet_step
from .quiet_shafts import quiet_shafts_step as quiet_shafts_step
from .record import FIELDS as FIELDS, INPUTS as INPUTS, KEPT as KEPT, LAWS as LAWS, Room as Room, SIZES as SIZES, WHOLE_NUMBERS as WHOLE_NUMBERS, layout_of as layout_of, room_shapes as room_shapes
from .result import Result as Result
from .small_vectors import add as add, dot as dot, product as product, put as put, scaled as scaled, vector as vector
from .state import Loads as Loads, State as State, Structure as Structure
from .system import System as System, torque_refused as torque_refused
from .tables import Table as Table, table_of as table_of
from .vibration import Modes as Modes, Response as Response, Sensitivities as Sensitivities, modes as modes, response as response, sensitivities as sensitivities
