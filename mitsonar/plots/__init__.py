"""Pictures of sonar datasets: waterfalls with the copper look, lines of soundings, focused images, all else in a
file, and videos.
"""
from .beams import beam_pattern
from .fan_video import video
from .fans import fan
from .focused import FOCUSED_VIEWS
from .line_views import LINE_VIEWS, line_figure
from .views import PLOTS, plot, preview, usual_plot

__all__ = ["FOCUSED_VIEWS", "LINE_VIEWS", "PLOTS", "beam_pattern", "fan", "line_figure", "plot", "preview",
           "usual_plot", "video"]
