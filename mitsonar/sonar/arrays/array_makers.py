"""Makers of arrays: lines, planes, crosses, cylinders, spheres and any list of positions.

    line        r_n = (n - (N - 1)/2) d â
    plane       the same along the axis, and across it for the rows
    cylinder    r_nm = a (n̂ cos φ_n + t̂ sin φ_n) + z_m â,   φ_n = ((n + 1/2)/N - 1/2) Ψ,   t̂ = â × n̂
    sphere      Fibonacci: cos θ_n = 1 - (1 - cos(Ψ/2)) (n + 1/2)/N,   φ_n = 2πn/g²,   g = (1 + √5)/2

N -> ``elements``, d -> ``pitch``, â -> ``axis``, n̂ -> ``normal``, a -> ``radius``, Ψ -> ``aperture``. Every array is
moved to the mean of its positions. Elements of lines and planes look along the normal, those of cylinders and spheres
outwards. All makers take ``**face``: length, height, pattern and baffle of the elements, see `Array`.

The Fibonacci lattice covers a sphere with equal areas (e.g. Swinbank and Purser 2006, Q. J. R. Meteorol. Soc. 132).
A line steered to ψ0 from broadside has no grating lobe where d < λ/(1 + |sin ψ0|).
"""
from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from .array import Array
from .array_checks import as_numbers
from .axes import AXES, across, axis_vector

GOLDEN = (1 + np.sqrt(5)) / 2


def element_array(position: ArrayLike, *, normal: str | ArrayLike = "down", along: str | ArrayLike = "forward",
                  **more: Any) -> Array:
    """Make an array of any positions.

    Parameters
    ----------
    position : array (E, 3) or (3,) [m]
        Body frame, about the array's centre; not moved.
    normal : str or array (3,) or (E, 3) [-]
        Where the elements look: a name of `axes.AXES`, one vector for all, or one each.
    along : str or array (3,) or (E, 3) [-]
        Which way the length of the faces lies; made perpendicular to the normals. Where it is parallel to one, forward
        takes its place, or starboard.
    **more
        length, height, pattern, baffle, weight and delay, as in `Array`.

    Returns
    -------
    Array

    Examples
    --------
    >>> element_array([[0, -0.1, 0], [0, 0.1, 0]], weight=[1, 0.5]).radius
    0.1
    """
    position = np.atleast_2d(as_numbers("position", position))
    position = position if position.size else np.empty((0, 3))
    normal, along = (_each(name, value, len(position)) for name, value in (("normal", normal), ("along", along)))
    return Array(position=position, normal=normal, along=across(normal, along), **more)


def _each(name: str, directions: str | ArrayLike, elements: int) -> np.ndarray:
    """Return unit vectors (elements, 3) of one direction or of one for each element."""
    if np.ndim(directions) < 2:
        return np.tile(axis_vector(f"array: {name}", directions), (elements, 1))
    vectors = cast(Sequence[ArrayLike], directions)
    if len(vectors) != elements:
        raise ValueError(f"array: {name} is given for {len(vectors)} elements of {elements}; give one for all or "
                         "one for each.")
    return np.array([axis_vector(f"array: {name} of element {e}", vector) for e, vector in enumerate(vectors)])


def line_array(elements: int, pitch: float, *, axis: str | ArrayLike = "starboard",
               normal: str | ArrayLike | None = None, **face: Any) -> Array:
    """Make a straight, evenly spaced line.

    Parameters
    ----------
    elements : int
    pitch : float [m]
        Distance from element to element.
    axis : str or array (3,) [-]
        Direction of the line, and of the length of its faces.
    normal : str or array (3,) [-]
        Normal of the elements; default down, or forward for a vertical line.
    **face
        As in `Array`.

    Returns
    -------
    Array

    Examples
    --------
    >>> line_array(3, 0.5).position[:, 1]
    array([-0.5,  0. ,  0.5])
    """
    axis = axis_vector("line array: axis", axis)
    place = _places("line array", "elements", elements, "pitch", pitch)
    if normal is None:
        normal = "forward" if _parallel(axis, AXES["down"]) else "down"
    normal = axis_vector("line array: normal", normal)
    return element_array(place[:, None] * axis, normal=normal, along=axis, layout=(len(place),), **face)


def planar_array(elements: int, rows: int, pitch: float, *, row_pitch: float | None = None,
                 axis: str | ArrayLike = "starboard", normal: str | ArrayLike = "down", **face: Any) -> Array:
    """Make a plane of rows, numbered along the axis, then row by row towards normal x axis.

    Parameters
    ----------
    elements : int
        In a row.
    rows : int
    pitch : float [m]
        From element to element in a row.
    row_pitch : float [m]
        From row to row; default ``pitch``.
    axis : str or array (3,) [-]
        Which way the rows run, and the length of their faces; made perpendicular to the normal.
    normal : str or array (3,) [-]
        Of the plane, where the elements look.
    **face
        As in `Array`.

    Returns
    -------
    Array
        Of rows x elements.
    """
    place = _places("planar array", "elements", elements, "pitch", pitch)
    row = _places("planar array", "rows", rows, "row_pitch", pitch if row_pitch is None else row_pitch)
    axis, normal = _square("planar array", axis, normal)
    position = (row[:, None, None] * np.cross(normal, axis) + place[:, None] * axis).reshape(-1, 3)
    return element_array(position, normal=normal, along=axis, layout=(len(row), len(place)), **face)


def mills_cross(transmit_elements: int, receive_elements: int, pitch: float, *, receive_pitch: float | None = None,
                axis: str | ArrayLike = "forward", normal: str | ArrayLike = "down",
                **face: Any) -> tuple[Array, Array]:
    """Make a transmitting line and a receiving one that crosses it.

    Parameters
    ----------
    transmit_elements, receive_elements : int
    pitch : float [m]
        Of the transmitting line.
    receive_pitch : float [m]
        Default ``pitch``.
    axis : str or array (3,) [-]
        Which way the transmitting line runs; the receiving one runs along normal x axis.
    normal : str or array (3,) [-]
        Where all elements look.
    **face
        As in `Array`, of both lines.

    Returns
    -------
    transmit, receive : Array
    """
    axis, normal = _square("Mills cross", axis, normal)
    transmit = line_array(transmit_elements, pitch, axis=axis, normal=normal, **face)
    receive = line_array(receive_elements, pitch if receive_pitch is None else receive_pitch,
                         axis=np.cross(normal, axis), normal=normal, **face)
    return transmit, receive


def cylindrical_array(elements: int, radius: float, *, rows: int = 1, row_pitch: float | None = None,
                      aperture: float = 2 * np.pi, axis: str | ArrayLike = "down", normal: str | ArrayLike = "forward",
                      **face: Any) -> Array:
    """Make rings of elements that look outwards, or arcs of them.

    Parameters
    ----------
    elements : int
        Elements of a ring, numbered from port to starboard for the default axis.
    radius : float [m]
    rows : int
        Number of rings along the axis.
    row_pitch : float [m]
        Distance from ring to ring; default: the distance of the elements of a ring along the arc.
    aperture : float [rad]
        Angle of the arc, divided into equal parts with an element in the middle of each.
    axis : str or array (3,) [-]
        Axis of the cylinder.
    normal : str or array (3,) [-]
        Normal of the middle of the arc; made perpendicular to the axis.
    **face
        As in `Array`; the length of the faces lies around the axis, the height along it.

    Returns
    -------
    Array
        Of rows x elements.
    """
    what = "cylindrical array"
    elements, radius = _count(what, "elements", elements), _size(what, "radius", radius)
    angle = ((np.arange(elements) + 0.5) / elements - 0.5) * _arc(what, aperture)
    row = _places(what, "rows", rows, "row_pitch", radius * aperture / elements if row_pitch is None else row_pitch)
    normal, axis = _square(what, normal, axis)
    turn = np.cross(axis, normal)
    outward = np.cos(angle)[:, None] * normal + np.sin(angle)[:, None] * turn
    around = np.cos(angle)[:, None] * turn - np.sin(angle)[:, None] * normal
    position = (row[:, None, None] * axis + radius * outward).reshape(-1, 3)
    return Array(position=position, normal=np.tile(outward, (len(row), 1)), along=np.tile(around, (len(row), 1)),
                 layout=(len(row), elements), **face).centred()


def spherical_array(elements: int, radius: float, *, aperture: float = 2 * np.pi, normal: str | ArrayLike = "down",
                    **face: Any) -> Array:
    """Make a sphere of evenly spread elements that look outwards, or a cap of one.

    Parameters
    ----------
    elements : int
    radius : float [m]
    aperture : float [rad]
        Full opening angle of the cap, seen from the centre; 2 pi is the whole sphere.
    normal : str or array (3,) [-]
        Where the middle of the cap looks.
    **face
        As in `Array`; the length of the faces lies around the normal.

    Returns
    -------
    Array
    """
    what = "spherical array"
    elements, radius = _count(what, "elements", elements), _size(what, "radius", radius)
    n = np.arange(elements)
    cosine = 1 - (1 - np.cos(_arc(what, aperture) / 2)) * (n + 0.5) / elements
    angle = 2 * np.pi * n / GOLDEN ** 2
    normal = axis_vector(f"{what}: normal", normal)
    first = across(normal, AXES["forward"])
    turned = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * np.cross(normal, first)
    outward = cosine[:, None] * normal + np.sqrt(1 - cosine ** 2)[:, None] * turned
    return Array(position=radius * outward, normal=outward, along=np.cross(normal, turned), **face).centred()


def _places(what: str, count_name: str, count: int, pitch_name: str, pitch: float) -> np.ndarray:
    """Return evenly spaced places [m] about 0."""
    count, pitch = _count(what, count_name, count), _size(what, pitch_name, pitch)
    return (np.arange(count) - (count - 1) / 2) * pitch


def _count(what: str, name: str, value: float) -> int:
    if not (np.ndim(value) == 0 and np.isfinite(value) and value >= 1 and value == int(value)):
        raise ValueError(f"{what}: {name} is {value}; give a whole number of at least 1.")
    return int(value)


def _size(what: str, name: str, value: float) -> float:
    if not (np.isfinite(value) and value > 0):
        raise ValueError(f"{what}: {name} is {value} m; give a finite length above 0.")
    return float(value)


def _arc(what: str, aperture: float) -> float:
    if not 0 < aperture <= 2 * np.pi * (1 + 1e-12):
        raise ValueError(f"{what}: aperture is {aperture} rad; give an angle above 0 and at most 2 pi (a whole turn).")
    return aperture


def _square(what: str, axis: str | ArrayLike, normal: str | ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Return an axis made perpendicular to a normal, and the normal, as unit vectors."""
    axis, normal = axis_vector(f"{what}: axis", axis), axis_vector(f"{what}: normal", normal)
    if _parallel(axis, normal):
        raise ValueError(f"{what}: axis and normal are parallel ({axis} and {normal}); turn one of them.")
    return across(normal, axis), normal


def _parallel(a: np.ndarray, b: np.ndarray | tuple[float, float, float]) -> bool:
    return bool(np.linalg.norm(np.cross(a, b)) < 1e-6)
