"""Rays of a rotating head's pings, drawn through quantile tables: see `tracing.launch`.

A direction is (u, φ) in the head's frame, d = (√(1 - u²) cos φ, u, √(1 - u²) sin φ). The table of u follows the lobes
at transmission and at reception, wherever the head turns meanwhile; those of φ follow the time axis.
"""
from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from ...device.arrays import arrays_of, upload
from ...sonar.sidescan import Sidescan
from ...tracing.launch import CELLS, along_quantiles, draw, first_quantiles
from ..array_survey import ArraySurvey
from ..places import Place
from ..rows import Rays
from ..side_launch import drawn_across, strata_of
from ..underway import Underway

__all__ = ["StepLaunch", "StepRays"]

SHIFTS = 9                         # that stand for all pings
WAYS = (-0.5, 0.0, 0.5)            # [rad] φ at which shifts are looked at


@dataclass(frozen=True, kw_only=True)
class StepRays(Rays):
    """Rays of a head's pings.

    Attributes
    ----------
    cell : UInt32 (R,)
        Of the table of φ that the ray was drawn through, (pings, CELLS).
    head : Vector3f (R,)
        Their directions in the head's frame.
    """

    cell: mi.UInt32
    head: mi.Vector3f


class StepLaunch:
    """Draw rays of pings.

    Parameters
    ----------
    survey : ArraySurvey
    face : Sidescan
    underway : Underway
    window : (float, float) [s]
        Two-way time that is recorded.
    """

    def __init__(self, survey: ArraySurvey, face: Sidescan, underway: Underway, window: tuple[float, float]):
        self._survey, self._face, self._window, self._lib = survey, face, window, arrays_of(mi.Float)
        shifts = underway.aside_shifts(survey.track.rotation(), face.sound_speed, WAYS)
        table = along_quantiles(face, np.unique(np.quantile(shifts, np.linspace(0, 1, SHIFTS))))
        self._along = upload(mi.Float, table.astype(np.float32))
        dr.eval(self._along)

    def first_quantiles(self, place: Place) -> np.ndarray:
        """Give the tables of φ, (pings, CELLS + 1) [rad], that suit a level bed."""
        survey = self._survey
        phi = np.linspace(-np.pi / 2, np.pi / 2, CELLS + 1)
        along = np.stack([np.cos(phi), 0 * phi, np.sin(phi)], -1)
        depression = np.arcsin(np.clip(-np.einsum("pj,kj->pk", place.rotation[:, 2], along), -1, 1))
        mean_speed = float(np.mean(survey.profile.at(np.linspace(*survey.geometry.depth_range, 9))))
        scatters = survey.geometry.surface_label and not survey.geometry.surface_mirrors
        return first_quantiles(self._face, depression, place.depth_below_of, mean_speed, self._window,
                               -place.position[:, 2] if scatters else None)

    def drawn(self, place: Place, quantiles: np.ndarray, grid: tuple[int, int], seed: int, salt: int) -> StepRays:
        """Draw the rays of a pass: `grid` strata in φ and u for each ping, through tables of φ."""
        strata = strata_of(self._lib, place.rows, grid)
        ping, phi, phi_width, cell, share = drawn_across(self._lib, place, strata, quantiles, seed, salt)
        u, u_width, _ = draw(self._along, mi.UInt32(0), share)
        w = dr.sqrt(dr.maximum(1 - u * u, 0))
        sine, cosine = dr.sincos(phi)
        head = mi.Vector3f(w * cosine, u, w * sine)
        return StepRays(ping=ping, cell=cell, head=head, direction=place.scene(ping, head),
                        solid_angle=phi_width * u_width / mi.Float(strata.per_row))
