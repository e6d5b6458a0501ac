"""Strengths as the instrument writes them: variable `written_backscatter_db` of soundings, beside `backscatter_db`.

`backscatter_db` stays the strength of the bed. An instrument adds corrections of the angle, and errors of what it
assumes; files of instruments hold the sum. Without any of these attributes there is no such variable.
"""
import numpy as np

from mitsonar.hydrography.detection.written_strength import ANGLE_LAWS, BeamPattern, StrengthWriting
from mitsonar.io.scene_files import beam_pattern

from ..attributes import Angle, Attributes, Boolean, Choice, File, Group, Number, Numbers

MOST_DB = 100.0                    # of errors and gains, either way
MOST_ABSORPTION = 10.0             # [dB/m]

WRITTEN_STRENGTHS = Group(title="Written strengths", module="films.strength_attributes", attributes=(
    Choice("written_beam_law", default="none", choices=ANGLE_LAWS,
           text="angle correction of the beams' strengths: Lambert's law removed, the rise about `normal` incidence "
                "flattened, or both"),
    Choice("written_image_law", default="none", choices=ANGLE_LAWS, text="the same of snippets"),
    Angle("written_crossover_deg", default=25.0, above=0, maximum=80,
          text="incidence where the rise about normal incidence begins, going inwards"),
    Number("written_normal_db", default=None, minimum=-100, maximum=50, unit="dB", otherwise="found from every ping",
           text="strength of the bed at normal incidence that the correction assumes (BSn)"),
    Number("written_oblique_db", default=None, minimum=-100, maximum=50, unit="dB", otherwise="found from every ping",
           text="the same at oblique incidence, without Lambert's law (BSo)"),
    Numbers("written_absorption_db", default=(), unit="dB/m", otherwise="the water's",
            text="one-way absorption that the instrument assumes, of each sector or all"),
    Numbers("written_source_level_error_db", default=(0.0,), unit="dB",
            text="source level that the instrument assumes, less the true one, of each sector or all"),
    Number("written_window_ms", default=None, above=0, maximum=1000, unit="ms", otherwise="the beam's footprint",
           text="time about the detection over which the instrument averages: a short one leaves the speckle"),
    Boolean("written_level_bed", default=False, text="true: the ensonified area is that of a level bed"),
    File("written_pattern", default=None,
         text="CSV: sector from 0, angle [deg] from the array's normal to starboard, level [dB]: pattern of both "
              "arrays, both ways, less that of the model"),
    File("written_pattern_correction", default=None,
         text="CSV likewise: the pattern that the instrument corrects for, right or wrong"),
    Numbers("written_gain_pings", default=(), unit="pings",
            text="pings, from 0, before which an operator changes a gain"),
    Numbers("written_gain_db", default=(), unit="dB",
            text="gain from each of these pings on, which the instrument does not correct"),
))


def read_strength_writing(attributes: Attributes, sectors: int) -> StrengthWriting | None:
    """Return how a sonar of so many sectors writes strengths; None if it writes those of the bed."""
    if not attributes.given(*(one.name for one in WRITTEN_STRENGTHS.attributes)):
        return None
    limits = (("written_absorption_db", 0.0, MOST_ABSORPTION), ("written_source_level_error_db", -MOST_DB, MOST_DB),
              ("written_gain_db", -MOST_DB, MOST_DB))
    for name, low, high in limits:
        values = getattr(attributes, name)
        if ((values < low) | (values > high)).any():
            raise attributes.error(f"{name} is {values.tolist()}; expected numbers from {low:g} to {high:g}.")
        if name != "written_gain_db" and len(values) not in ((1, sectors) if name != "written_absorption_db"
                                                             else (0, 1, sectors)):
            raise attributes.error(f"{name} has {len(values)} numbers; give one, or one for each of the {sectors} "
                                   "sectors of all swaths.")
    pings, gains = attributes.written_gain_pings, attributes.written_gain_db
    if len(pings) != len(gains) or (pings != np.floor(pings)).any() or (np.diff(pings, prepend=-1) <= 0).any():
        raise attributes.error(f"written_gain_pings is {pings.tolist()} and written_gain_db {gains.tolist()}; give as "
                               "many gains as pings, and whole pings that rise from 0 or more.")
    return StrengthWriting(
        beam_law=attributes.written_beam_law, image_law=attributes.written_image_law,
        crossover=attributes.written_crossover_deg, normal_db=attributes.written_normal_db,
        oblique_db=attributes.written_oblique_db, absorption_db=tuple(attributes.written_absorption_db.tolist()),
        source_level_error_db=tuple(attributes.written_source_level_error_db.tolist()),
        window=None if attributes.written_window_ms is None else attributes.written_window_ms / 1000,
        level_bed=attributes.written_level_bed, pattern=_pattern(attributes, "written_pattern", sectors),
        pattern_correction=_pattern(attributes, "written_pattern_correction", sectors),
        gain_steps=tuple(zip(pings.astype(int).tolist(), gains.tolist())))


def _pattern(attributes: Attributes, name: str, sectors: int) -> BeamPattern | None:
    """Return the pattern in a file, if there is one."""
    path = getattr(attributes, name)
    if path is None:
        return None
    try:
        pattern = beam_pattern.read(path)
    except ValueError as error:
        raise attributes.error(error) from None
    if pattern.sector.max() >= sectors:
        raise attributes.error(f"{name} has a sector {pattern.sector.max()}, but the sonar has {sectors} of all "
                               "swaths, counted from 0; leave it out.")
    return pattern
