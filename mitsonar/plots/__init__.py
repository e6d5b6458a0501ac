"""Pictures of sonar datasets: the waterfall with the copper look, and plots of everything else in a file."""
from .views import PLOTS, plot, preview

__all__ = ["PLOTS", "plot", "preview"]
