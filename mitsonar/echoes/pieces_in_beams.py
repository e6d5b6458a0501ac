"""Which pieces of facets the beams of an array make negligible, and which they do not touch: cells need not be asked.

A piece of radius r whose middle is d away fills an angle of r / (d - r). Rays to its cells leave within WIDER times
that of the ray to its middle: bent water spreads them. With `ElementBeams.bound` b at the middle, and that angle added
to what the bound allows for, or taken from it,

    b(+) negligible       no cell counts
    b(-) large enough     all cells count
    else                  each cell is looked at
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import arrays_of, upload
from ..tracing.connection import Connector
from ..tracing.tracer import Sources
from .element_beams import ElementBeams
from .pieces import Pieces

__all__ = ["NEGLIGIBLE", "pieces_in_beams"]

NEGLIGIBLE = 1e-8                  # two-way intensity of the beams below which a cell is not looked at
WIDER = 2.0
LARGEST = 0.1                      # [rad] pieces that fill more are looked at cell by cell,
FEWEST_CELLS = 4                   # and all of them if they have fewer each


def pieces_in_beams(pieces: Pieces, connector: Connector, beams: ElementBeams, sources: Sources, origin: dr.ArrayBase,
                    rotation: np.ndarray, enough: float = NEGLIGIBLE) -> tuple[np.ndarray, np.ndarray]:
    """Sort pieces of facets by what the beams make of them.

    Parameters
    ----------
    pieces : Pieces
    connector : Connector
    beams : ElementBeams
    sources, origin : Sources, Array3f64 (1,) [m]
        As of `Connector.connect`.
    rotation : (3, 3)
        Body to scene.
    enough : float [-]
        Two-way intensity above which cells count.

    Returns
    -------
    found : (P,) int
        -1: negligible, 1: all count, 0: each cell has to be looked at.
    bound : (P,) [-]
        Two-way intensity that no cell of a piece exceeds.
    """
    if not len(pieces.facet) or pieces.cells.sum() < FEWEST_CELLS * len(pieces.facet):
        return np.zeros(len(pieces.facet), int), np.ones(len(pieces.facet))
    lib = arrays_of(mi.Float)
    point = lib.Array3f64(*(upload(mi.Float64, column) for column in pieces.centre.T))
    distance = dr.norm(point - origin)
    radius = upload(mi.Float64, pieces.radius)
    angle = mi.Float(WIDER * radius / dr.maximum(distance - radius, 1e-9))
    direction = connector.launch_direction(sources, origin, mi.UInt32(0), point)
    most, least = (beams.bound(direction, mi.Float(distance), rotation, wider) for wider in (angle, -angle))
    small = angle < WIDER * LARGEST
    dr.eval(small, most, least)
    inside, outside = ((small & decided).numpy() for decided in (least > enough, most <= NEGLIGIBLE))
    return inside.astype(int) - outside, np.where(small.numpy(), most.numpy(), 1.0)
