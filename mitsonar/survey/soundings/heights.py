"""Levels that depths of soundings are reduced to: a tide, or heights above the ellipsoid less a separation."""
from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mitsonar.device.earth import Frame
from mitsonar.hydrography.reduction.motion_errors import SensedMotion
from mitsonar.io.grids.separation import Separation
from mitsonar.io.tracks.tides import Tide
from mitsonar.sonar.motion.trajectory import SmoothCurve

from .survey import SoundedSurvey

REDUCED_BY = ("tide", "gnss")


@dataclass(frozen=True, kw_only=True)
class DepthReference:
    """Heights in use; None where they are the scene's own."""

    tide: Tide | float | None = None  # [m]
    separation: Separation | None = None
    heights: str = "tide"  # one of `REDUCED_BY`

    def __post_init__(self):
        if self.heights not in REDUCED_BY:
            raise ValueError(f"heights is {self.heights!r}; give {' or '.join(REDUCED_BY)}.")
        if self.heights == "gnss" and self.tide is not None:
            raise ValueError("a tide and heights by gnss are both given; heights above the ellipsoid need no tide, "
                             "leave one of them out.")


@dataclass(frozen=True, kw_only=True, eq=False)
class EllipsoidHeights:
    """Heights of the reference point above the ellipsoid, by satellites, and both separations, at the motion's times.
    """

    time: np.ndarray  # (M,) [s]
    height: np.ndarray  # (M,) [m]
    separation: np.ndarray  # (M,) [m], in use
    true_separation: np.ndarray  # (M,) [m]
    reduce: bool  # True if depths are reduced by these heights
    datum: str  # name of the vertical datum, or none

    @classmethod
    def of(cls, survey: SoundedSurvey, sensed: SensedMotion, by: DepthReference) -> EllipsoidHeights | None:
        """Return the heights of a line; None where nobody asks for them and the water has no separation."""
        true = survey.separation
        reduce = by.heights == "gnss"
        used = by.separation or true
        if used is None:
            if reduce or survey.motion_errors.separation_error:
                raise ValueError("heights above the ellipsoid need a separation, and neither the water nor the "
                                 "reduction has one; give the separation of the seawater, or --separation.")
            return None
        motion, frame = sensed.motion, place_of(survey)
        there = (true or Separation()).at(motion.x, motion.y, frame)
        stated = there if used is true else used.at(motion.x, motion.y, frame)
        return cls(time=motion.time, height=there + sensed.rise, true_separation=there, reduce=reduce,
                   separation=stated + survey.motion_errors.separation_error, datum=survey.vertical_datum)

    def at(self, time: float) -> dict[str, float]:
        """Return the variables of a ping at its time [s]."""
        height, separation, true = self._curve.at(np.array(time))
        return {"ping_height": float(height), "separation": float(separation), "true_separation": float(true)}

    @cached_property
    def _curve(self) -> SmoothCurve:
        """Return the curve of all three, which is made once."""
        return SmoothCurve(self.time, np.stack([self.height, self.separation, self.true_separation], -1))


def place_of(survey: SoundedSurvey) -> Frame | None:
    """Return the place on Earth of a scene: that of its bed, else of its track; None without one."""
    world, frame = survey.world, survey.passage.frame
    crs = world.crs or (None if frame is None else frame.crs)
    if crs is None:
        return None
    origin = world.local_origin if world.local_origin is not None else getattr(frame, "origin")
    return Frame(crs=crs, origin=(float(origin[0]), float(origin[1])))
