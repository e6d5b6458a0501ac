"""Pictures of sonar datasets: waterfalls with the copper look, lines of soundings, focused images, all else in a
file, and videos.
"""
from .fans.fan_video import video
from .fans.fans import fan
from .images.focused import FOCUSED_VIEWS
from .images.views import PLOTS, plot, preview, usual_plot
from .lines.line_views import LINE_VIEWS, line_figure
from .sheets.beams import beam_pattern

__all__ = ["FOCUSED_VIEWS", "LINE_VIEWS", "PLOTS", "beam_pattern", "fan", "line_figure", "plot", "preview",
           "usual_plot", "video"]
