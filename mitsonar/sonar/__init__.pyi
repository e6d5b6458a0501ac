from .arrays.array import Array as Array
from .arrays.array_makers import (
    cylindrical_array as cylindrical_array,
    element_array as element_array,
    line_array as line_array,
    mills_cross as mills_cross,
    planar_array as planar_array,
    spherical_array as spherical_array,
)
from .arrays.axes import body_direction as body_direction
from .arrays.beam_patterns import (
    beam_pattern as beam_pattern,
    directivity_index_db as directivity_index_db,
    element_directivity_index_db as element_directivity_index_db,
)
from .faces.directivity import Aperture as Aperture, length_for_beam_width as length_for_beam_width
from .faces.sidescan import Sidescan as Sidescan
from .motion.track import Track as Track
from .preset_tables import presets as presets
from .pulses.pulse import Pulse as Pulse
from .pulses.pulses import (
    PULSES as PULSES,
    cw as cw,
    hfm as hfm,
    lfm as lfm,
    pulse_of as pulse_of,
    sampled as sampled,
)
