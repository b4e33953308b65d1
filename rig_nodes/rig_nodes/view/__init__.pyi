# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

# The names of this room that others use; __init__.py finds each in its module when it is asked for.

from .message_blocks import Blocks as Blocks
from .campaign import campaign_of_sweep as campaign_of_sweep, figures_of_campaign as figures_of_campaign, read_campaign as read_campaign
from .chart import Line as Line, chart as chart, front as front, write_charts as write_charts
from .compare_file import write_compare_file as write_compare_file
from .convert import View as View, import_rerun as import_rerun, make_close_view as make_close_view, make_tab_view as make_tab_view, make_view as make_view
from .draw import draw_figure as draw_figure, write_figure as write_figure
from .figure import Description as Description
from .figure_of_compare import figures_of_compare as figures_of_compare
from .figure_of_modes import figure_of_modes as figure_of_modes
from .figure_of_run import figures_of_run as figures_of_run
from .figure_of_shift import figure_of_shift as figure_of_shift, figures_of_shifts as figures_of_shifts
from .live import Sender as Sender, Server as Server, live_topics as live_topics
from .other_tools import write_layout as write_layout
from .page_of_faults import faults_page as faults_page
from .page_of_report import Facts as Facts, campaign_page as campaign_page, compare_page as compare_page, report_page as report_page
from .pages import Pages as Pages
from .pdf import browser as browser, pdf_of as pdf_of
from .picture import require_driver as require_driver, take_picture as take_picture
from .recorded import Envelope as Envelope
from .viewer import command_for as command_for, has_display as has_display, open_window as open_window
