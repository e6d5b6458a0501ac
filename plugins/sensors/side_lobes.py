"""Floors of side lobes of faces and arrays, which the kinds of sonar declare alike; -200 dB leaves a floor out."""
from mitsonar.units import power_from_db

from ..attributes import Number
from .sonar_sensor import LOWEST_DB

LOUDEST_FLOOR_DB = -3.0

VERTICAL_SIDELOBE = Number(
    "vertical_sidelobe_db", minimum=LOWEST_DB, maximum=LOUDEST_FLOOR_DB, unit="dB",
    text="mean level of the diffuse side lobes across the fan, of each face, one way, relative to its axis: it fills "
         "the nulls between side lobes, which are black arcs otherwise; -20 to -30")

RECEIVE_FLAWS = Number(
    "receive_flaws", default=0.0, minimum=0, maximum=1,
    text="rms error of each receiver's amplitude [1] and phase [rad], which beamforming does not correct: diffuse side "
         "lobes of twice its square over the number of receivers of a row; 0.1 to 0.3")


def power_of(level_db: float) -> float:
    """Return a power; 0 for the faintest level."""
    return float(power_from_db(level_db)) if level_db > LOWEST_DB else 0.0
