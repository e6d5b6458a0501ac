"""Uncertainty of planned soundings by angle, compared with an order of S-44, and the widest useful swath.

A level sonar at depth h sails over a level bed at depth d. The beam of angle θ meets the bed at y = r(θ, d) (`rays`),
and the standard deviations of its depth and place are those of `hydrography.reduction.uncertainty`:

    TVU = 1.96 sqrt(Σ v²)            THU = 2.448 / sqrt(2) sqrt(Σ w²)            at 95 %

v, w -> vertical and horizontal deviation of each cause. The swath is useful up to the first angle at which TVU or THU
exceeds what the order allows.

Along the track, pings lie v / n apart, and the beam straight below covers 2 (d - h) tan(w / 2) of the bed:

    no gaps                up to v = n 2 (d - h) tan(w / 2)
    k pings on a feature   up to v = n a / k

v -> speed; n -> ping rate; w -> width of the transmit beam; a -> least feature that the order asks for.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from mitsonar.device.spelling import meant
from mitsonar.hydrography.reduction.uncertainty import Accuracies, BeamGeometry, causes
from mitsonar.hydrography.survey_orders import HORIZONTAL_95, VERTICAL_95, SurveyOrder
from mitsonar.units import radians_from_deg
from mitsonar.water.profile import SoundSpeedProfile

from ..coverage import PlannedTrack, SwathSonar
from ..rays import distance
from .cast_errors import within_angle

ANGLES = 65
HITS = 3                           # pings on a feature that is to be detected
IN_DEGREES = ("angle", "roll", "pitch", "heading")
LARGEST = 1000.0                   # of a stated accuracy


@dataclass(frozen=True, kw_only=True, eq=False)
class SwathBudget:
    """Uncertainty at 95 % of beams at angles (A,) [rad] over a level bed, and what an order allows, in [m].

    ``parts`` holds the vertical and horizontal part (A,) [m] of every cause, at 95 % likewise.
    """

    depth: float
    angle: np.ndarray
    vertical: np.ndarray
    horizontal: np.ndarray
    parts: dict[str, tuple[np.ndarray, np.ndarray]]
    allowed_vertical: float
    allowed_horizontal: float

    @property
    def good_angle(self) -> float:
        """Return the angle [rad] up to which both uncertainties stay within the order."""
        return within_angle(self.angle, self.share, 1.0)

    @property
    def share(self) -> np.ndarray:
        """Return the larger uncertainty (A,), relative to what the order allows."""
        return np.maximum(self.vertical / self.allowed_vertical, self.horizontal / self.allowed_horizontal)

    def main_cause(self, beam: int = -1) -> str:
        """Return the cause with the largest share of what limits a beam."""
        side = int(self.horizontal[beam] / self.allowed_horizontal > self.vertical[beam] / self.allowed_vertical)
        return max(self.parts, key=lambda name: float(self.parts[name][side][beam]))


def swath_budget(profile: SoundSpeedProfile, sonar: SwathSonar, depth: float, accuracies: Accuracies,
                 order: SurveyOrder, speed: float) -> SwathBudget:
    """Return the budget of a swath over a level bed [m], at a speed over ground [m/s]."""
    angle = np.linspace(0.0, 0.5 * sonar.swath, ANGLES)
    across = distance(profile, sonar.head_depth, np.full(angle.size, float(depth)), angle)
    still = np.zeros(angle.size)
    geometry = BeamGeometry(ahead=still, across=across, below=np.full(angle.size, depth - sonar.head_depth),
                            arms=np.zeros(3), steered=angle, tilt=still, heave=still, fall=still,
                            speed=np.array(profile.at(sonar.head_depth)),
                            rates=(still, still, still, still + speed))
    parts = {name: (VERTICAL_95 * np.abs(vertical), HORIZONTAL_95 * np.abs(horizontal)) for name, (vertical, horizontal)
             in causes(geometry, accuracies, accuracies.time, accuracies.angle).items()}
    vertical, horizontal = (np.sqrt(sum(np.square(part[side]) for part in parts.values())) for side in (0, 1))
    return SwathBudget(depth=float(depth), angle=angle, vertical=vertical, horizontal=horizontal, parts=parts,
                       allowed_vertical=float(order.vertical(depth)), allowed_horizontal=float(order.horizontal(depth)))


def useful_swath(budgets: Sequence[SwathBudget], order: SurveyOrder) -> float:
    """Return the swath [rad] within which all budgets hold; `ValueError` if the vertical beam does not hold."""
    worst = min(budgets, key=lambda budget: budget.good_angle)
    if not worst.good_angle > 0:
        raise ValueError(f"at {worst.depth:.4g} m no beam is within order {order.name}: straight below, TVU is "
                         f"{worst.vertical[0]:.2f} of {worst.allowed_vertical:.2f} m and THU {worst.horizontal[0]:.2f} "
                         f"of {worst.allowed_horizontal:.2f} m, most by {worst.main_cause(0)}; use better sensors, or "
                         "another --order.")
    return 2 * worst.good_angle


@dataclass(frozen=True, kw_only=True)
class AlongTrack:
    """Pings along the track where they lie farthest apart; lengths in [m], speeds in [m/s], None if not known."""

    depth: float
    spacing: float
    footprint: float | None  # of the beam straight below, where it is shortest for its pings
    gapless_speed: float | None  # highest without gaps between these footprints
    feature: float | None  # least one that the order asks for
    hits: float | None  # pings on it
    feature_speed: float | None  # highest with `HITS` pings on it


def along_track(tracks: Sequence[PlannedTrack], sonar: SwathSonar, order: SurveyOrder, speed: float) -> AlongTrack:
    """Return the pings along planned lines at a speed [m/s]."""
    rate, depth = (np.concatenate([getattr(track, name) for track in tracks]) for name in ("rate", "depth"))
    below = np.maximum(depth - sonar.head_depth, 0.0)
    sizes = np.array([order.least_feature(float(value)) or np.nan for value in depth])
    footprints = None if sonar.beam_width is None else 2 * below * np.tan(0.5 * sonar.beam_width)
    slowest = int(np.argmin(rate))
    known = order.feature is not None
    return AlongTrack(
        depth=float(depth[slowest]), spacing=speed / float(rate[slowest]),
        footprint=None if footprints is None else float(footprints[np.argmin(footprints * rate)]),
        gapless_speed=None if footprints is None else float(np.min(footprints * rate)),
        feature=float(np.min(sizes)) if known else None, hits=float(np.min(sizes * rate)) / speed if known else None,
        feature_speed=float(np.min(sizes * rate)) / HITS if known else None)


def accuracies_of(texts: Sequence[str]) -> Accuracies:
    """Return accuracies from texts such as "tide=0.1" or "roll_deg=0.02"; those not named keep their defaults."""
    known = [field.name for field in fields(Accuracies) if field.name != "heave_share"]       # a plan has no heave
    names = {f"{name}_deg" if name in IN_DEGREES else name: name for name in known}
    given = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or name not in names:
            raise ValueError(f"--accuracy is {text!r}{meant(name, names)}; give NAME=VALUE, with one of the names "
                             f"{', '.join(names)}.")
        if names[name] in given:
            raise ValueError(f"--accuracy {name} is given twice; leave one out.")
        try:
            number = float(value)
            if not 0 <= number <= LARGEST:
                raise ValueError
        except ValueError:
            raise ValueError(f"--accuracy {name} is {value!r}; give a standard deviation from 0 to {LARGEST:g}."
                             ) from None
        given[names[name]] = float(radians_from_deg(number)) if names[name] in IN_DEGREES else number
    return Accuracies(**given)
