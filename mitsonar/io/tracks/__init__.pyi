from .navigation import Frame as Frame, Navigation as Navigation, Waypoints as Waypoints
from .tides import Tide as Tide
from .tracks import load as load, read as read, waypoints as waypoints
