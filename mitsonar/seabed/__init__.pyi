from .bed import Bed as Bed
from .bodies import Body as Body
from .placement import Placed as Placed, Rules as Rules, draw_count as draw_count, place as place
