"""The attributes that describe an array of a sonar in a scene file, for sensors that have one.

Each array has a prefix, ``receive`` or ``transmit``, which stands in front of every name below; so ``receive_pitch`` is
the pitch of the receiving array. The body's axes are ``forward``, ``aft``, ``starboard``, ``port``, ``down`` and
``up``; a direction is one of them or three numbers "forward, starboard, down".

- ``receive`` [point]: the kind of array, one of

  - ``point``: one element
  - ``line``: ``_elements`` at ``_pitch`` along ``_axis`` [starboard]
  - ``planar``: ``_rows`` [1] of these, ``_row_pitch`` apart
  - ``cylindrical``: rings around ``_axis`` [down] of ``_elements`` each, ``_rows`` [1], ``_row_pitch`` apart;
    ``_aperture_deg`` [360] makes them arcs, and ``_radius`` may stand in the place of ``_pitch``
  - ``spherical``: ``_elements`` over a sphere, or over a cap that opens ``_aperture_deg`` [360]; ``_radius`` or
    ``_pitch``
  - ``file``: the CSV file ``_file`` with the columns x, y, z [m], and if wanted nx, ny, nz, ax, ay, az, weight, delay
    (see `mitsonar.io.arrays`)

- ``_pitch``, ``_row_pitch``, ``_radius`` [m]: the pitch is half a wavelength if not written, and that of the rows is
  the pitch
- ``_normal``: where the elements look, the middle of a cylinder or sphere [down; forward for a cylinder, and for a line
  that hangs]
- ``_offset`` (point) [m]: of the array's centre from where the track leads, forward, starboard, down
- ``_element_length``, ``_element_height`` [m, 0]: of each element's face, along the axis (around it on cylinders and
  spheres) and across; ``_pattern``: ``omni``, ``rectangular`` [if a size is written] or ``circular`` (the length is
  the diameter); ``_baffle`` [none], ``hard``, ``soft`` or ``cardioid``
- ``_shading``: a window with its numbers, such as "hann" or "chebwin 30"; arrays of rows take two, "taylor, hann":
  along the axis and across the rows
- ``_failed``: numbers of elements that do not work, from 0, such as "3, 17"
- ``_jitter`` [m, 0]: rms error of each coordinate of the elements, unknown to the steering; ``_jitter_seed``: another
  number, other errors
- ``_steer_deg``: azimuth from the bow, positive to starboard, and depression below the horizontal, such as "90, 45";
  ``_focus`` [m]: distance of the focus in that direction, along the normal where none is written

.. code-block:: xml

    <string name="receive" value="line"/>
    <integer name="receive_elements" value="64"/>
    <float name="receive_pitch" value="0.0075"/>
    <string name="receive_shading" value="chebwin 30"/>
"""
import contextlib
import zlib
from functools import partial

import numpy as np

from mitsonar.io import arrays
from mitsonar.plugins.attributes import REQUIRED
from mitsonar.sonar import (body_direction, cylindrical_array, element_array, line_array, planar_array,
                            spherical_array)
from mitsonar.sonar.axes import AXES, axis_vector
from mitsonar.sonar.element_patterns import BAFFLES, PATTERNS
from mitsonar.units import radians_from_deg

__all__ = ["KINDS", "read_array"]

MOST_ELEMENTS = 100_000
SOUND_SPEED = 1500.0               # [m/s] where the sensor knows no better


def read_array(attributes, prefix, sound_speed_hint=None, *, frequency=None):
    """Read the array that attributes with a prefix describe.

    Parameters
    ----------
    attributes : Attributes
        Of the sensor, which calls ``finish`` itself.
    prefix : str
        ``transmit`` or ``receive``.
    sound_speed_hint : float [m/s]
        At the array, for steering, focus and the default pitch; default 1500.
    frequency : float [Hz]
        For the default pitch, half a wavelength; without it a pitch or radius must be written.

    Returns
    -------
    Array

    Raises
    ------
    ValueError
        If an attribute is missing, out of range, or one that this kind of array does not take.
    """
    sound_speed = SOUND_SPEED if sound_speed_hint is None else sound_speed_hint
    read = _Prefixed(attributes, prefix, None if frequency is None else 0.5 * sound_speed / frequency)
    kind = attributes.text(prefix, "point", choices=tuple(KINDS))
    maker, takes = KINDS[kind]
    for name in sorted({name for _, names in KINDS.values() for name in names} - set(takes)):
        if attributes.given(read.name(name)):
            raise attributes.error(f'{read.name(name)} is written, but {prefix} is "{kind}", which takes '
                                   f"{', '.join(map(read.name, takes))}; leave it out or change {prefix}.")
    make = maker(read)
    changes = [*_steering(read, sound_speed), *_elements(read)]
    face, offset = _face(read), attributes.point(read.name("offset"), None)
    with read.named():
        array = make(**face)
        for change in changes:
            array = change(array)
        return array if offset is None else array.moved(offset)


class _Prefixed:
    """Attributes whose names begin alike; spacing [m] is the default pitch."""

    def __init__(self, attributes, prefix, spacing):
        self.attributes, self.prefix, self.spacing = attributes, prefix, spacing

    def name(self, suffix):
        return f"{self.prefix}_{suffix}"

    @contextlib.contextmanager
    def named(self):
        """Say plugin and prefix in front of what an array's maker has to say."""
        try:
            yield
        except ValueError as error:
            raise self.attributes.error(f"{self.prefix}: {error}") from None

    def count(self, suffix, default=REQUIRED):
        return self.attributes.integer(self.name(suffix), default, minimum=1, maximum=MOST_ELEMENTS)

    def size(self, suffix, default=REQUIRED):
        return self.attributes.number(self.name(suffix), default, above=0, unit="m")

    def pitch(self):
        return self.size("pitch", REQUIRED if self.spacing is None else self.spacing)

    def row_pitch(self):
        return self.size("row_pitch", None)

    def direction(self, suffix, default):
        text = self.attributes.text(self.name(suffix), default)
        if text is None:
            return None
        direction = text.strip()
        if direction not in AXES:
            with contextlib.suppress(ValueError):
                direction = [float(word) for word in text.replace(",", " ").split()]
        try:
            return axis_vector(self.name(suffix), direction)
        except ValueError as error:
            raise self.attributes.error(str(error)) from None

    def radius(self, from_pitch):
        """The radius as written, or that which spaces the elements at the pitch."""
        both = self.attributes.given(self.name("radius"), self.name("pitch"))
        if len(both) == 2:
            raise self.attributes.error(f"{' and '.join(both)} are both given; one follows from the other, leave one "
                                        "out.")
        return self.size("radius") if self.name("radius") in both else from_pitch(self.pitch())


# ---- the kinds: each reads its attributes and gives a maker that still wants the elements' faces

def _point(read):
    return partial(element_array, [0.0, 0.0, 0.0], normal=read.direction("normal", "down"))


def _line(read):
    return partial(line_array, read.count("elements"), read.pitch(), axis=read.direction("axis", "starboard"),
                   normal=read.direction("normal", None))


def _planar(read):
    return partial(planar_array, read.count("elements"), read.count("rows", 1), read.pitch(),
                   row_pitch=read.row_pitch(), axis=read.direction("axis", "starboard"),
                   normal=read.direction("normal", "down"))


def _cylindrical(read):
    elements, aperture = read.count("elements"), _aperture(read)
    return partial(cylindrical_array, elements, read.radius(lambda pitch: elements * pitch / aperture),
                   rows=read.count("rows", 1), row_pitch=read.row_pitch(), aperture=aperture,
                   axis=read.direction("axis", "down"), normal=read.direction("normal", "forward"))


def _spherical(read):
    elements, aperture = read.count("elements"), _aperture(read)
    unit_area = 2 * np.pi * (1 - np.cos(aperture / 2))
    return partial(spherical_array, elements, read.radius(lambda pitch: pitch * np.sqrt(elements / unit_area)),
                   aperture=aperture, normal=read.direction("normal", "down"))


def _file(read):
    return partial(arrays.read, read.attributes.file(read.name("file")), normal=read.direction("normal", "down"))


def _aperture(read):
    return read.attributes.angle(read.name("aperture_deg"), 360, above=0, maximum=360)


# kind -> what reads it, and the attributes that only some kinds take
KINDS = {
    "point": (_point, ("normal",)),
    "line": (_line, ("elements", "pitch", "axis", "normal")),
    "planar": (_planar, ("elements", "rows", "pitch", "row_pitch", "axis", "normal")),
    "cylindrical": (_cylindrical, ("elements", "rows", "pitch", "row_pitch", "radius", "aperture_deg", "axis",
                                   "normal")),
    "spherical": (_spherical, ("elements", "pitch", "radius", "aperture_deg", "normal")),
    "file": (_file, ("file", "normal")),
}


# ---- what all kinds have

def _face(read):
    length, height = (read.attributes.number(read.name(f"element_{side}"), 0.0, minimum=0, unit="m")
                      for side in ("length", "height"))
    pattern = read.attributes.text(read.name("pattern"), "rectangular" if length or height else "omni",
                                   choices=tuple(PATTERNS))
    baffle = read.attributes.text(read.name("baffle"), "none", choices=tuple(BAFFLES))
    return {"length": length, "height": height, "pattern": pattern, "baffle": baffle}


def _steering(read, sound_speed):
    """Changes of the array that steer or focus it."""
    angles = read.attributes.numbers(read.name("steer_deg"), None, count=2, unit="degrees")
    focus = read.size("focus", None)
    direction = None
    if angles is not None:
        if abs(angles[1]) > 90:
            raise read.attributes.error(f"{read.name('steer_deg')} has a depression of {angles[1]:g} degrees; give "
                                        "azimuth first, then a depression from -90 to 90.")
        direction = body_direction(*radians_from_deg(angles))
    if focus is not None:
        yield lambda array: array.focused(focus * _looking(array, direction), sound_speed)
    elif direction is not None:
        yield lambda array: array.steered(direction, sound_speed)


def _looking(array, direction):
    """The direction, or where the array's elements look together."""
    if direction is None:
        direction = array.normal.mean(axis=0)
        if np.linalg.norm(direction) < 1e-2:
            raise ValueError("its elements look everywhere, so the focus has no direction; write steer_deg as well.")
        direction = direction / np.linalg.norm(direction)
    return direction


def _elements(read):
    """Changes of single elements: shading, failures, errors of place."""
    windows = read.attributes.text(read.name("shading"), None)
    if windows is not None:
        yield lambda array: array.shaded(*windows.split(","))
    failed = read.attributes.numbers(read.name("failed"), None)
    if failed is not None:
        whole = failed.astype(int) if np.array_equal(failed, np.rint(failed)) else failed
        yield lambda array: array.failing(whole)
    jitter = read.attributes.number(read.name("jitter"), None, minimum=0, unit="m")
    # Arrays of one sensor must not share their errors.
    seed = read.attributes.integer(read.name("jitter_seed"), zlib.crc32(read.prefix.encode()), minimum=0)
    if jitter is not None:
        yield lambda array: array.jittered(jitter, seed)
    elif read.attributes.given(read.name("jitter_seed")):
        raise read.attributes.error(f"{read.name('jitter_seed')} is written, but {read.name('jitter')} is not; write "
                                    "the rms error [m], or leave the seed out.")
