"""Sonars: arrays and their beams, pulses, tracks and the motion of what carries them."""
from .arrays.array_makers import (
                                  Array,
                                  cylindrical_array,
                                  element_array,
                                  line_array,
                                  mills_cross,
                                  planar_array,
                                  spherical_array,
)
from .arrays.axes import body_direction
from .arrays.beam_patterns import beam_pattern, directivity_index_db, element_directivity_index_db
from .faces.directivity import Aperture, length_for_beam_width
from .faces.sidescan import Sidescan
from .motion.track import Track
from .presets import presets
from .pulses.pulses import PULSES, Pulse, cw, hfm, lfm, pulse_of, sampled

__all__ = ["Aperture", "Array", "PULSES", "Pulse", "Sidescan", "Track", "beam_pattern", "body_direction", "cw",
           "cylindrical_array", "directivity_index_db", "element_array", "element_directivity_index_db", "hfm",
           "length_for_beam_width", "lfm", "line_array", "mills_cross", "planar_array", "presets", "pulse_of",
           "sampled", "spherical_array"]
