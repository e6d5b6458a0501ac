"""Pictures of sonar datasets: the waterfall with the copper look, and plots of everything else in a file."""
from .beams import beam_pattern
from .fans import fan
from .views import PLOTS, plot, preview

__all__ = ["PLOTS", "beam_pattern", "fan", "plot", "preview"]
