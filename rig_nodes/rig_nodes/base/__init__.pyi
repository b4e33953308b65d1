# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

# The names of this room that others use; __init__.py finds each in its module when it is asked for.

from .arguments import Parser as Parser
from .arrays import Floats as Floats, Ints as Ints, Record as Record
from .atomic import MAKER as MAKER, atomic_write as atomic_write
from .clocks import COMMAND_TIMEOUT as COMMAND_TIMEOUT, MOST_DELAY as MOST_DELAY, ROW as ROW, SAMPLE as SAMPLE, SAMPLE_NS as SAMPLE_NS, TICK_SAMPLES as TICK_SAMPLES
from .compiled import ALLOCATES as ALLOCATES, Compiled as Compiled, INLINED as INLINED, INNER as INNER, cache_root as cache_root, cgutils as cgutils, intrinsic as intrinsic, ir as ir, njit as njit, one_record as one_record, sources_key as sources_key, types as types, use_kernel_cache as use_kernel_cache
from .config import CONFIG_DIR as CONFIG_DIR, RIGS_DIR as RIGS_DIR, RUN_FILE as RUN_FILE, TEMPLATE_DIR as TEMPLATE_DIR, load_yaml as load_yaml, package_file as package_file
from .entry_points import Group as Group
from .errors import DiskFull as DiskFull, BagError as BagError, RigError as RigError, RigWarning as RigWarning, Terminated as Terminated, brief as brief, ended_by as ended_by, interrupted_code as interrupted_code, no_file as no_file, not_written as not_written, printable as printable, quoted as quoted
from .keep import kept as kept, kept_folder as kept_folder
from .link import ANSWERED as ANSWERED, DISCARDED as DISCARDED, FAILED as FAILED, Frames as Frames, Link as Link, LinkClosed as LinkClosed, NOT_AT_ALL as NOT_AT_ALL, PATIENCE as PATIENCE, READY as READY, STATUS as STATUS, pair as pair
from .names import DEFAULT_RIG as DEFAULT_RIG, RIGS as RIGS, RIG_FILE as RIG_FILE, beside as beside, find_config as find_config, find_of_rigs as find_of_rigs, has_controller as has_controller, installed as installed, meant as meant, rig_folders as rig_folders, rig_of as rig_of, rig_with as rig_with, unknown as unknown, unknown_value as unknown_value, with_bases as with_bases
from .optional import Lacking as Lacking, need_ros as need_ros, optional as optional
from .products import KINDS as KINDS, Kind as Kind, NEVER as NEVER, check_product as check_product
from .progress import ProgressLine as ProgressLine, STARTING as STARTING, waiting as waiting
from .schema import SWITCH as SWITCH, WORDS as WORDS, build as build, check_keys as check_keys, choice as choice, entry as entry, fill as fill, param as param, record_dtype as record_dtype, switch as switch, value_of as value_of
from .typed_arguments import number_within as number_within, seconds_of_bag as seconds_of_bag
from .uninterrupted import Uninterrupted as Uninterrupted
from .units import NOT_WRITTEN as NOT_WRITTEN, SI as SI, UNITS as UNITS, dimension_of as dimension_of, dimension_of_text as dimension_of_text, number_text as number_text, quantity as quantity, shown_in as shown_in, span as span, with_article as with_article
from .versions import version_of as version_of
from .yaml_file import List as List, Map as Map, file_of as file_of, merged as merged, read_yaml as read_yaml, stamped as stamped, where_of as where_of
