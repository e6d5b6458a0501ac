"""Scattering strength of the seabed and the sea surface in decibels, by law.

    S(θ_i, θ_s, φ) = 10 log10 σ,        S_b(θ) = S(θ, θ, π)

σ is the power scattered per area and solid angle over the incident intensity; θ -> ``grazing_in``, ``grazing_out``,
``grazing_angle``, φ -> ``azimuth``, 0 forward and π back.
"""
from __future__ import annotations

from dataclasses import MISSING, dataclass, fields
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from . import lambert
from .elastic_sediment import ElasticSediment
from .empirical import EmpiricalSeabed
from .sea_surface import SeaSurface
from .sediment import Sediment


@runtime_checkable
class ScatteringLaw(Protocol):
    """Interface of all scattering laws."""

    def scattering_strength(self, grazing_in: np.ndarray, grazing_out: np.ndarray, azimuth: np.ndarray,
                            frequency: np.ndarray, sound_speed: np.ndarray, /) -> np.ndarray:
        """Return σ [-], for angles [rad], frequency [Hz] and sound speed [m/s] that broadcast."""
        ...


@dataclass(frozen=True, kw_only=True)
class LambertSeabed:
    """Seabed of Lambert's law, the same at all frequencies.

    Parameters
    ----------
    mu_db : float [dB]
        Strength 10 log μ, at most -4.97 dB, at which all incident energy is scattered.

    Raises
    ------
    ValueError
        If ``mu_db`` is not finite or too large.
    """

    mu_db: float

    def __post_init__(self):
        strongest = 10 * np.log10(lambert.STRONGEST)
        if not -np.inf < self.mu_db <= strongest:
            raise ValueError(f"lambert: mu_db is {self.mu_db}; it must be a finite number up to {strongest:.2f} dB, "
                             "above which more would come back than arrives.")

    def scattering_strength(self, grazing_in: ArrayLike, grazing_out: ArrayLike, azimuth: ArrayLike,
                            frequency: ArrayLike, sound_speed: ArrayLike) -> np.ndarray:
        """Return σ [-], which depends on the grazing angles [rad] only; the other arguments are broadcast."""
        sines = np.broadcast_arrays(np.sin(grazing_in), np.sin(grazing_out), azimuth, frequency, sound_speed)
        return lambert.scattering_strength(10 ** (self.mu_db / 10), *sines[:2])


# Laws by name: classes of objects with scattering_strength(grazing_in, grazing_out, azimuth, frequency, sound_speed)
LAWS = {"lambert": LambertSeabed, "sediment": Sediment, "elastic": ElasticSediment, "empirical": EmpiricalSeabed,
        "sea_surface": SeaSurface}
NAMED = {"sediment": "medium sand", "elastic": "rock"}     # laws with named seabeds, and an example name


def backscatter_strength_db(law: str | ScatteringLaw, grazing_angle: ArrayLike, frequency: ArrayLike, *,
                            sound_speed: ArrayLike = 1500.0, **parameters: Any) -> np.ndarray:
    """Return the backscatter strength of a seabed or the sea surface.

    Parameters
    ----------
    law : str or object
        "lambert", "sediment" (a fluid), "elastic" (a solid), "empirical", "sea_surface", or an object such as
        ``Sediment.of("medium sand")``, ``LambertSeabed(mu_db=-27)`` or ``SeaSurface(wind_speed=8)``.
    grazing_angle : array [rad]
        Angle from the plane of the surface, 0..π/2.
    frequency : array [Hz]
    sound_speed : array [m/s]
        Sound speed of the water at the surface. All arrays broadcast.
    **parameters
        Parameters of a law given by name. "lambert": ``mu_db``. "sediment": the name ``sediment`` and fields of
        ``Sediment`` to replace, or all fields without a name. "elastic": likewise with ``ElasticSediment``.
        "empirical": ``angles``, ``strengths_db``, ``frequencies`` of ``EmpiricalSeabed``. "sea_surface":
        ``wind_speed`` [m/s].

    Returns
    -------
    array [dB re 1 m^2/m^2]
        Backscatter strength; -inf at grazing angle 0.

    Raises
    ------
    ValueError
        If an argument is out of range, or the law does not hold for the sediment at this frequency.

    Examples
    --------
    >>> import numpy as np
    >>> from mitsonar.scattering import backscatter_strength_db
    >>> backscatter_strength_db("sediment", np.radians([20, 45]), 100e3, sediment="medium sand").round(2)
    array([-24.98, -21.14])
    """
    return bistatic_strength_db(law, grazing_angle, grazing_angle, np.pi, frequency, sound_speed=sound_speed,
                                **parameters)


def bistatic_strength_db(law: str | ScatteringLaw, grazing_in: ArrayLike, grazing_out: ArrayLike, azimuth: ArrayLike,
                         frequency: ArrayLike, *, sound_speed: ArrayLike = 1500.0, **parameters: Any) -> np.ndarray:
    """Return the scattering strength of a seabed or the sea surface from one direction to another.

    Parameters
    ----------
    law, frequency, sound_speed, **parameters
        As in ``backscatter_strength_db``.
    grazing_in, grazing_out : array [rad]
        Grazing angles of the incident and scattered sound, 0..π/2.
    azimuth : array [rad]
        Horizontal angle between incident and scattered directions: 0 forward, π back.

    Returns
    -------
    array [dB re 1 m^2/m^2]

    Raises
    ------
    ValueError
        As ``backscatter_strength_db`` does.
    """
    seabed = _seabed(law, parameters)
    way_in = _checked("grazing angle", grazing_in, 0, np.pi / 2, "rad")
    way_out = _checked("grazing angle", grazing_out, 0, np.pi / 2, "rad")
    turn = _checked("azimuth", azimuth, -2 * np.pi, 2 * np.pi, "rad")
    hertz = _checked("frequency", frequency, 1.0, 1e7, "Hz")
    speed = _checked("sound_speed", sound_speed, 1000.0, 2000.0, "m/s")
    with np.errstate(divide="ignore"):  # grazing angle 0 scatters nothing: -inf dB
        return 10 * np.log10(seabed.scattering_strength(way_in, way_out, turn, hertz, speed))


def _seabed(law: str | ScatteringLaw, parameters: dict[str, Any]) -> ScatteringLaw:
    """Return the scattering law of a name and its parameters, or the given law itself."""
    if not isinstance(law, str):
        if not isinstance(law, ScatteringLaw):
            raise ValueError(f"the law is {law!r}; give a law's name, one of {', '.join(LAWS)}, or a law.")
        if parameters:
            raise ValueError(f"{law} has its parameters in it; {', '.join(parameters)} must not be given besides.")
        return law
    if law not in LAWS:
        raise ValueError(f'no law of scattering is called "{law}"; known are {", ".join(LAWS)}.')
    kind = LAWS[law]
    known = [field.name for field in fields(kind)] + ["sediment"] * (law in NAMED)
    unknown = [name for name in parameters if name not in known]
    if unknown:
        raise ValueError(f"{law} has no parameter {unknown[0]}; it has {', '.join(known)}.")
    if "sediment" in parameters:
        return kind.of(parameters["sediment"], **{k: v for k, v in parameters.items() if k != "sediment"})
    missing = [field.name for field in fields(kind) if field.default is MISSING and field.name not in parameters]
    if missing:
        instead = f', or name one by sediment="{NAMED[law]}"' if law in NAMED else ""
        raise ValueError(f"{law} is given too little; give {', '.join(missing)}{instead}.")
    return kind(**parameters)


def _checked(name: str, value: ArrayLike, low: float, high: float, unit: str) -> np.ndarray:
    """Return the value as a float64 array; raise ValueError with the first value outside low..high."""
    array = np.asarray(value, float)
    bad = ~((array >= low) & (array <= high))
    if bad.any():
        raise ValueError(f"{name} is {array[bad].flat[0]:g} {unit}; it must lie in {low:g}..{high:g} {unit}.")
    return array
