"""Pictures of sonar datasets: the waterfall with the copper look, plots of everything else in a file, and videos."""
from .beams import beam_pattern
from .fan_video import video
from .fans import fan
from .views import PLOTS, plot, preview

__all__ = ["PLOTS", "beam_pattern", "fan", "plot", "preview", "video"]
