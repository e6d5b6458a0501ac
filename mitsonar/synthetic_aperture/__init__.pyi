from . import micronavigation as micronavigation, record as record
from .focusing import grids as grids
from .focusing.focusing import focus as focus
from .focusing.grids import (
    Grid as Grid,
    circle_grid as circle_grid,
    ground_grid as ground_grid,
    slant_grid as slant_grid,
    strip_grid as strip_grid,
)
from .micronavigation.micronavigation import micronavigate as micronavigate, straightened as straightened
from .products import (
    change as change,
    coherence as coherence,
    coherence_statistics as coherence_statistics,
    interferometry as interferometry,
)
from .products.change import change_map as change_map
from .products.interferometry import (
    height_of_phase as height_of_phase,
    interferogram as interferogram,
    phase_of_height as phase_of_height,
)
from .products.point_response import PointResponse as PointResponse, point_response as point_response
from .products.speckle import Speckle as Speckle, speckle as speckle
