from .amplitudes import read_amplitudes as read_amplitudes
from .xtf import Written as Written, write as write
