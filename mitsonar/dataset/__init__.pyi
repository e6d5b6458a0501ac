from . import labels as labels, scores as scores
from .images import Images as Images, open as open
from .rendered_images import rendering as rendering
