"""Transmit and receive arrays of a sonar: elements anywhere on the body.

Every name begins with ``receive`` or ``transmit``: ``receive_pitch`` is the pitch of the receive array. The axes of the
body are ``forward``, ``aft``, ``starboard``, ``port``, ``down`` and ``up``. A direction is one of them, or three
numbers "forward, starboard, down". Arrays are of one of these kinds:

- ``point``: one element
- ``line``: ``_elements`` at ``_pitch`` along ``_axis``
- ``planar``: ``_rows`` such lines, ``_row_pitch`` apart
- ``cylindrical``: ``_rows`` rings around ``_axis``, ``_row_pitch`` apart, with ``_elements`` each; ``_aperture_deg``
  makes them arcs, and ``_radius`` may replace ``_pitch``
- ``spherical``: ``_elements`` over a sphere, or over a cap that opens ``_aperture_deg``; ``_radius`` or ``_pitch``
- ``file``: elements of a CSV file, see `mitsonar.io.scene_files.arrays`

.. code-block:: xml

    <string name="receive" value="line"/>
    <integer name="receive_elements" value="64"/>
    <float name="receive_pitch" value="0.0075"/>
    <string name="receive_shading" value="chebwin 30"/>
"""
from dataclasses import replace

from mitsonar.sonar.arrays.array_checks import FARTHEST
from mitsonar.sonar.arrays.element_patterns import BAFFLES, PATTERNS

from ..attributes import Angle, Choice, File, Group, Integer, Number, Numbers, Point, Text
from .sonar_sensor import VERTICAL_SIDELOBE

MOST_ELEMENTS = 100_000
ALL_KINDS = ("point", "line", "planar", "cylindrical", "spherical", "file")
WITH_ELEMENTS = ("line", "planar", "cylindrical", "spherical")

ARRAYS = Group(title="Arrays", module="sensors.array_attributes", prefixes=("transmit", "receive"), attributes=(
    Choice("", default="point", choices=ALL_KINDS,
           text="kind of the array; the attributes from here to `_file` belong to the kinds that they name"),
    Integer("_elements", minimum=1, maximum=MOST_ELEMENTS, only=("", WITH_ELEMENTS),
            text="number of elements of the line or sphere, or of each row or ring"),
    Integer("_rows", default=1, minimum=1, maximum=MOST_ELEMENTS, only=("", ("planar", "cylindrical")),
            text="number of rows of a plane, or of rings of a cylinder"),
    Number("_pitch", default=None, above=0, maximum=FARTHEST, unit="m", otherwise="half a wavelength",
           only=("", WITH_ELEMENTS), text="distance between elements"),
    Number("_row_pitch", default=None, above=0, maximum=FARTHEST, unit="m", otherwise="the pitch",
           only=("", ("planar", "cylindrical")), text="distance between rows"),
    Number("_radius", default=None, above=0, maximum=FARTHEST, unit="m", only=("", ("cylindrical", "spherical")),
           text="radius, instead of the pitch"),
    Angle("_aperture_deg", default=360.0, above=0, maximum=360, only=("", ("cylindrical", "spherical")),
          text="opening angle of an arc of a cylinder, or of a cap of a sphere"),
    Text("_axis", default=None, otherwise="`starboard`; `down` for cylinders",
         only=("", ("line", "planar", "cylindrical")), text="direction of lines, rows and cylinders"),
    File("_file", only=("", ("file",)),
         text="CSV file with x, y, z [m], and optionally nx, ny, nz, ax, ay, az, weight, delay"),
    Text("_normal", default=None, only=("", ALL_KINDS),
         otherwise="`down`; `forward` for cylinders and vertical lines",
         text='direction that elements face: `forward`, `aft`, `starboard`, `port`, `down`, `up` or "1, 0, 0.2"'),
    Point("_offset", default=None, otherwise="0",
          text="position of the array's centre relative to the track: forward, starboard, down"),
    Number("_element_length", default=0.0, minimum=0, maximum=FARTHEST, unit="m",
           text="length of an element's face along the array"),
    Number("_element_height", default=0.0, minimum=0, maximum=FARTHEST, unit="m", text="height of the face across it"),
    Choice("_pattern", default=None, choices=tuple(PATTERNS), otherwise="`rectangular` where a size is written",
           text="beam pattern of each element; for `circular`, the length is the diameter"),
    replace(VERTICAL_SIDELOBE, name="_vertical_sidelobe_db", default=None, otherwise="none",
            text="mean level of the diffuse side lobes of each rectangular face across its length, one way, relative "
                 "to its axis; it fills the nulls between side lobes; -20 to -30"),
    Choice("_baffle", default="none", choices=tuple(BAFFLES), text="baffle behind each element"),
    Text("_shading", default=None, text='window over the elements, such as "chebwin 30"; for rows two, such as '
                                        '"taylor, hann": along the axis and across the rows'),
    Numbers("_failed", default=None, text="numbers of dead elements, counted from 0"),
    Number("_jitter", default=None, minimum=0, maximum=1000, unit="m", otherwise="0",
           text="rms error of each coordinate of the elements; steering does not correct it"),
    Integer("_jitter_seed", default=None, minimum=0, otherwise="one each",
            text="seed of these errors, and of receivers' `receive_flaws`"),
    Numbers("_steer_deg", default=None, count=2, unit="degrees",
            text='"azimuth, depression" of the beam, from the bow to starboard and below the horizontal'),
    Number("_focus", default=None, above=0, maximum=10**9, unit="m",
           text="distance of a focus in that direction, or along the normal where none is written"),
))

PICTURE = Choice("picture", default=None, choices=("beams", "elements"), otherwise="beams where possible",
                 text="method: `beams`, for a line or rows of receivers, puts echoes on a grid of time and sine, at "
                      "video rate; `elements` forms beams from the elements' signals, for any array, and takes a "
                      "hundred times as long")
