from . import canvas as canvas
from .fans.fan_video import video as video
from .fans.fans import fan as fan
from .images.focused import FOCUSED_VIEWS as FOCUSED_VIEWS
from .images.views import PLOTS as PLOTS, plot as plot, preview as preview, usual_plot as usual_plot
from .lines.line_views import LINE_VIEWS as LINE_VIEWS, line_figure as line_figure
from .sheets.beams import beam_pattern as beam_pattern
from .sheets.fit_sheet import fit_figure as fit_figure
