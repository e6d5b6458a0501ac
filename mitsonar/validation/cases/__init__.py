"""Comparisons, one in each module: rows of computed and expected numbers, with the allowed error."""
from . import (
    beams,
    closure,
    crossover,
    elements,
    ghosts,
    rays,
    sediments,
    statistics,
    surface,
    targets,
    vectors,
    volume,
    water,
)

CASES = {
    "water": water.CASE,
    "rays": rays.CASE,
    "vectors": vectors.CASE,
    "sediments": sediments.CASE,
    "beams": beams.CASE,
    "closure": closure.CASE,
    "elements": elements.CASE,
    "statistics": statistics.CASE,
    "targets": targets.CASE,
    "crossover": crossover.CASE,
    "surface": surface.CASE,
    "volume": volume.CASE,
    "ghosts": ghosts.CASE,
}
