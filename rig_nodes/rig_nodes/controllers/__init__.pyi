# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

# The names of this room that others use; __init__.py finds each in its module when it is asked for.

from . import own_signals as own_signals
from .alfa46.box import refusal as refusal
from .c.library import CLibrary as CLibrary, COMPILERS as COMPILERS, INCLUDE as INCLUDE, LEVEL_BITS as LEVEL_BITS
from .c.record_header import NAME as NAME, header_text as header_text
from .can.database import ADDRESS as ADDRESS, dbc_text as dbc_text, need_can as need_can
from .can.dm1 import ActiveCode as ActiveCode
from .can.frames import RigFrames as RigFrames
from .can.j1939 import ADDRESS_CLAIMED as ADDRESS_CLAIMED, FUNCTION as FUNCTION, identifier as identifier
from .fmi.importer import Fmu as Fmu
from .load import IN_PROCESS as IN_PROCESS, PLUGS as PLUGS, embedded_line as embedded_line, level_line as level_line, load_controller as load_controller, split_level as split_level
from .modbus.registers import csv_text as csv_text, markdown_text as markdown_text
from .plug import Answer as Answer, DECLARED as DECLARED, Plug as Plug
from .record import ControllerRecord as ControllerRecord, flat_parameters as flat_parameters, record_of as record_of
from .ros.domain import Domain as Domain, allocate as allocate, announce as announce, busy_domains as busy_domains, check_namespace as check_namespace, environment as environment, from_environment as from_environment, numbered as numbered, of_running_rig as of_running_rig, participants as participants, running_rigs as running_rigs, until_free as until_free, use_own_transports as use_own_transports
from .seam import ControllerFailed as ControllerFailed, ControllerInfo as ControllerInfo, ControllerInputs as ControllerInputs, ControllerOutputs as ControllerOutputs, LEVELS as LEVELS, Status as Status, error_text as error_text
from .templates import TEMPLATES as TEMPLATES, write_template as write_template
from .udp.frames import PORT as PORT
