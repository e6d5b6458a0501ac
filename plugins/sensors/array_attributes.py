"""The arrays of a sonar: elements anywhere on the body.

Each array has a prefix, ``receive`` or ``transmit``, in front of every name; so ``receive_pitch`` is the pitch of the
receiving array. The body's axes are ``forward``, ``aft``, ``starboard``, ``port``, ``down`` and ``up``; a direction is
one of them or three numbers "forward, starboard, down". The kinds of arrays are

- ``point``: one element
- ``line``: ``_elements`` at ``_pitch`` along ``_axis``
- ``planar``: ``_rows`` of these, ``_row_pitch`` apart
- ``cylindrical``: rings around ``_axis`` of ``_elements`` each, ``_rows`` of them, ``_row_pitch`` apart;
  ``_aperture_deg`` makes them arcs, and ``_radius`` may stand in the place of ``_pitch``
- ``spherical``: ``_elements`` over a sphere, or over a cap that opens ``_aperture_deg``; ``_radius`` or ``_pitch``
- ``file``: elements of a CSV file, see `mitsonar.io.scene_files.arrays`

.. code-block:: xml

    <string name="receive" value="line"/>
    <integer name="receive_elements" value="64"/>
    <float name="receive_pitch" value="0.0075"/>
    <string name="receive_shading" value="chebwin 30"/>
"""
from mitsonar.sonar.arrays.array_checks import FARTHEST
from mitsonar.sonar.arrays.element_patterns import BAFFLES, PATTERNS

from ..attributes import Angle, Choice, File, Group, Integer, Number, Numbers, Point, Text

MOST_ELEMENTS = 100_000
ALL_KINDS = ("point", "line", "planar", "cylindrical", "spherical", "file")
WITH_ELEMENTS = ("line", "planar", "cylindrical", "spherical")

ARRAYS = Group(title="Arrays", module="sensors.array_attributes", prefixes=("transmit", "receive"), attributes=(
    Choice("", default="point", choices=ALL_KINDS,
           text="kind of the array; a kind takes what follows, to `_file`, where that says so"),
    Integer("_elements", minimum=1, maximum=MOST_ELEMENTS, only=("", WITH_ELEMENTS),
            text="of a line, of each row or ring, of a sphere"),
    Integer("_rows", default=1, minimum=1, maximum=MOST_ELEMENTS, only=("", ("planar", "cylindrical")),
            text="of planes, or rings of cylinders"),
    Number("_pitch", default=None, above=0, maximum=FARTHEST, unit="m", otherwise="half a wavelength",
           only=("", WITH_ELEMENTS), text="between elements"),
    Number("_row_pitch", default=None, above=0, maximum=FARTHEST, unit="m", otherwise="the pitch",
           only=("", ("planar", "cylindrical")), text="between rows"),
    Number("_radius", default=None, above=0, maximum=FARTHEST, unit="m", only=("", ("cylindrical", "spherical")),
           text="in place of the pitch"),
    Angle("_aperture_deg", default=360.0, above=0, maximum=360, only=("", ("cylindrical", "spherical")),
          text="of cylinders that are arcs, of spheres that are caps"),
    Text("_axis", default=None, otherwise="`starboard`; `down` of cylinders",
         only=("", ("line", "planar", "cylindrical")), text="direction of lines, rows and cylinders"),
    File("_file", only=("", ("file",)), text="CSV: x, y, z [m], and if wanted nx, ny, nz, ax, ay, az, weight, delay"),
    Text("_normal", default=None, only=("", ALL_KINDS),
         otherwise="`down`; `forward` of cylinders and of lines that hang",
         text='where elements look: `forward`, `aft`, `starboard`, `port`, `down`, `up` or "1, 0, 0.2"'),
    Point("_offset", default=None, otherwise="0", text="of the array's centre from where the track leads: forward, "
                                                       "starboard, down"),
    Number("_element_length", default=0.0, minimum=0, maximum=FARTHEST, unit="m", text="of a face along the array"),
    Number("_element_height", default=0.0, minimum=0, maximum=FARTHEST, unit="m", text="across"),
    Choice("_pattern", default=None, choices=tuple(PATTERNS), otherwise="`rectangular` where a size is written",
           text="of each element; of `circular` ones the length is the diameter"),
    Choice("_baffle", default="none", choices=tuple(BAFFLES), text="behind each element"),
    Text("_shading", default=None, text='window over the elements, such as "chebwin 30"; of rows two, "taylor, hann": '
                                        "along the axis and across the rows"),
    Numbers("_failed", default=None, text="numbers of dead elements, from 0"),
    Number("_jitter", default=None, minimum=0, maximum=1000, unit="m", otherwise="0",
           text="rms error of every coordinate of the elements, unknown to steering"),
    Integer("_jitter_seed", default=None, minimum=0, otherwise="one each", text="other numbers, other errors"),
    Numbers("_steer_deg", default=None, count=2, unit="degrees",
            text='"azimuth, depression" from the bow to starboard and below the horizontal'),
    Number("_focus", default=None, above=0, maximum=10**9, unit="m",
           text="distance of a focus in that direction; along the normal where none is written"),
))

PICTURE = Choice("picture", default=None, choices=("beams", "elements"), otherwise="beams where that can be done",
                 text="how the picture is made: `beams`, for a line or rows of receivers, lays echoes on a grid of "
                      "time and sine, at video rate; `elements` forms beams of the elements' own signals, of any "
                      "array, and takes a hundred times as long")
