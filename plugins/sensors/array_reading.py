"""Make an array from the attributes of `array_attributes`."""
import contextlib
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from mitsonar.io.scene_files import arrays
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.array_makers import (
    cylindrical_array,
    element_array,
    line_array,
    planar_array,
    spherical_array,
)
from mitsonar.sonar.arrays.axes import AXES, axis_vector, body_direction
from mitsonar.survey.sensor import Water
from mitsonar.survey.voyage import Route
from mitsonar.units import radians_from_deg

from ..attributes import Attributes
from .sonar_sensor import power_of

SOUND_SPEED = 1500.0               # [m/s] where the sensor gives none


def read_array(attributes: Attributes, prefix: str, sound_speed_hint: float | None = None, *,     # [m/s]
               frequency: float | None = None) -> Array:                                           # [Hz]
    """Make the array that the attributes with a prefix describe."""
    sound_speed = SOUND_SPEED if sound_speed_hint is None else sound_speed_hint
    array = _Prefixed(attributes, prefix, None if frequency is None else 0.5 * sound_speed / frequency)
    make = KINDS[getattr(attributes, prefix)](array)
    changes = [*_steering(array, sound_speed), *_elements(array)]
    with array.named():
        made = make(**_face(array))
        for change in changes:
            made = change(made)
        return made if array.offset is None else made.moved(array.offset)


def nominal_sound_speed(written: float | None, water: Water, route: Route) -> float:
    """Return the sound speed [m/s] at the arrays before the track is laid: as written, or the profile's at the start.
    """
    if written:
        return written
    profile = water.profile
    return float(np.mean(profile.sound_speed) if route.start is None else profile.at(-route.start[2]))


def with_elements_changed(attributes: Attributes, prefix: str, made: Array) -> Array:
    """Return an array with the shading, failures and position errors that the attributes with a prefix describe."""
    array = _Prefixed(attributes, prefix, None)
    changes = [*_elements(array)]
    with array.named():
        for change in changes:
            made = change(made)
    return made


def with_flaws(attributes: Attributes, receive: Array) -> Array:
    """Return receivers with the errors of their channels."""
    rms = attributes.receive_flaws
    return receive.flawed(rms, attributes.receive_jitter_seed) if rms else receive


class _Prefixed:
    """Attributes with a common prefix; `spacing` [m] is the default pitch."""

    def __init__(self, attributes: Attributes, prefix: str, spacing: float | None) -> None:
        self.attributes, self.prefix, self.spacing = attributes, prefix, spacing

    def __getattr__(self, suffix: str) -> Any:
        return getattr(self.attributes, self.name(suffix))

    def name(self, suffix: str) -> str:
        return f"{self.prefix}_{suffix}"

    @contextlib.contextmanager
    def named(self) -> Iterator[None]:
        """Put plugin and prefix in front of errors of an array maker."""
        try:
            yield
        except ValueError as error:
            raise self.attributes.error(f"{self.prefix}: {error}") from None

    def spaced(self) -> float:
        """Return the pitch as written, or half a wavelength."""
        pitch = self.spacing if self.pitch is None else self.pitch
        if pitch is None:
            raise self.attributes.error(f"attribute {self.name('pitch')} is missing; expected a number [m] above 0.")
        return pitch

    def direction(self, suffix: str, default: str | None) -> np.ndarray | None:
        """Return a direction of the body's frame."""
        text = getattr(self, suffix) if getattr(self, suffix) is not None else default
        if text is None:
            return None
        direction = text.strip()
        if direction not in AXES:
            with contextlib.suppress(ValueError):
                direction = [float(word) for word in text.replace(",", " ").split()]
        try:
            return axis_vector(self.name(suffix), direction)
        except ValueError as error:
            raise self.attributes.error(error) from None

    def curved(self, from_pitch: Callable[[float], float]) -> float:
        """Return the radius as written, or the radius that spaces the elements at the pitch."""
        both = self.attributes.given(self.name("radius"), self.name("pitch"))
        if len(both) == 2:
            raise self.attributes.error(f"{' and '.join(both)} are both given; one follows from the other, leave one "
                                        "out.")
        return from_pitch(self.spaced()) if self.radius is None else self.radius


# ---- the kinds: each returns a maker that still needs the elements' faces

def _point(array):
    return partial(element_array, [0.0, 0.0, 0.0], normal=array.direction("normal", "down"))


def _line(array):
    return partial(line_array, array.elements, array.spaced(), axis=array.direction("axis", "starboard"),
                   normal=array.direction("normal", None))


def _planar(array):
    return partial(planar_array, array.elements, array.rows, array.spaced(), row_pitch=array.row_pitch,
                   axis=array.direction("axis", "starboard"), normal=array.direction("normal", "down"))


def _cylindrical(array):
    elements, aperture = array.elements, array.aperture_deg
    return partial(cylindrical_array, elements, array.curved(lambda pitch: elements * pitch / aperture),
                   rows=array.rows, row_pitch=array.row_pitch, aperture=aperture,
                   axis=array.direction("axis", "down"), normal=array.direction("normal", "forward"))


def _spherical(array):
    elements, aperture = array.elements, array.aperture_deg
    unit_area = 2 * np.pi * (1 - np.cos(aperture / 2))
    return partial(spherical_array, elements, array.curved(lambda pitch: pitch * np.sqrt(elements / unit_area)),
                   aperture=aperture, normal=array.direction("normal", "down"))


def _file(array):
    return partial(arrays.read, array.file, normal=array.direction("normal", "down"))


KINDS = {"point": _point, "line": _line, "planar": _planar, "cylindrical": _cylindrical, "spherical": _spherical,
         "file": _file}


# ---- attributes of all kinds

def _face(array):
    length, height = array.element_length, array.element_height
    pattern = array.pattern or ("rectangular" if length or height else "omni")
    floor = 0.0 if array.vertical_sidelobe_db is None else power_of(array.vertical_sidelobe_db)
    return {"length": length, "height": height, "floor": floor, "pattern": pattern, "baffle": array.baffle}


def _steering(array, sound_speed):
    """Yield changes of the array that steer or focus it."""
    angles, focus, direction = array.steer_deg, array.focus, None
    if angles is not None:
        if abs(angles[1]) > 90:
            raise array.attributes.error(f"{array.name('steer_deg')} has a depression of {angles[1]:g} degrees; give "
                                         "azimuth first, then a depression from -90 to 90.")
        direction = body_direction(*radians_from_deg(angles))
    if focus is not None:
        yield lambda made: made.focused(focus * _focus_direction(made, direction), sound_speed)
    elif direction is not None:
        yield lambda made: made.steered(direction, sound_speed)


def _focus_direction(array, direction):
    """Return the direction, or by default the mean normal of the elements."""
    if direction is None:
        direction = array.normal.mean(axis=0)
        if np.linalg.norm(direction) < 1e-2:
            raise ValueError("its elements look everywhere, so the focus has no direction; write steer_deg as well.")
        direction = direction / np.linalg.norm(direction)
    return direction


def _elements(array):
    """Yield changes of single elements: shading, failures, position errors."""
    windows, failed, jitter = array.shading, array.failed, array.jitter
    if windows is not None:
        yield lambda made: made.shaded(*windows.split(","))
    if failed is not None:
        numbers = failed.astype(int) if np.array_equal(failed, np.rint(failed)) else failed
        yield lambda made: made.failing(numbers)
    # arrays of one sensor must not share their errors
    seed = zlib.crc32(array.prefix.encode()) if array.jitter_seed is None else array.jitter_seed
    if jitter is not None:
        yield lambda made: made.jittered(jitter, seed)
    elif array.jitter_seed is not None and not (array.prefix == "receive"
                                                and getattr(array.attributes, "receive_flaws", 0)):
        raise array.attributes.error(f"{array.name('jitter_seed')} is written, but {array.name('jitter')} is not; "
                                     "write the rms error [m], or leave the seed out.")
