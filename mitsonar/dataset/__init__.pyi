from . import labels as labels
from .images import Images as Images, open as open
