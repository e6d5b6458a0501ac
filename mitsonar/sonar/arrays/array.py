"""Array of transducer elements: positions, directions of their faces, weights and delays.

    s(t) = Σ_e w_e s_e(t - τ_e)                       receiving; transmitting, element e sends w_e s(t - τ_e)

w_e -> ``weight``, τ_e -> ``delay`` [s], of the element at r_e -> ``position`` [m]. Towards a distant point in the
direction û, or a point R, an array is steered by

    τ_e = r_e·û / c          τ_e = (|R| - |R - r_e|) / c

c -> ``sound_speed``: an element nearer to the point waits longer, and the array's centre does not wait, so ranges stay.
Everything is in the body frame (x forward, y starboard, z down), about the array's centre, where the track leads.
"""
from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.device.types import Numbers, Triple

from .array_checks import as_numbers, check_face, checked_speed, positions_of, refuse, vector_of
from .axes import axis_vector
from .channels import flawed
from .element_patterns import element_pressure
from .shading import window_weights

SQUARE = 1e-6                      # cosine up to which along counts as perpendicular to the normal
EVEN = 1e-5                        # of the pitch, that elements of a uniform line may be off their places


class Face(NamedTuple):
    """Elements that look the same way: their indices (K,), and the normal (3,) and along (3,) that they share."""

    indices: np.ndarray
    normal: np.ndarray
    along: np.ndarray


@dataclass(frozen=True, eq=False, kw_only=True)
class Array:
    """Array of E elements, made by `line_array` and similar functions; its methods return changed copies.

    Attributes
    ----------
    position : array (E, 3) [m]
        Body frame, about the array's centre.
    normal : array (E, 3) [-]
        Normal of each face, normalised to unit vectors.
    along : array (E, 3) [-]
        Direction of each face's length, perpendicular to the normal; made unit vectors.
    length, height : float [m]
        Size of every element's face, along ``along`` and across; a circle's length is its diameter, its height 0.
    pattern : str
        ``omni``, ``rectangular`` or ``circular``.
    floor : float [-]
        Mean power of the diffuse side lobes of a rectangular face across its length, relative to its axis.
    baffle : str
        ``none``, ``hard``, ``soft`` or ``cardioid``.
    weight : array (E,) or float [-]
        Weight of each element; 0 for a failed one.
    delay : array (E,) or float [s]
        Delay of each element's signal.
    channel : complex array (E,) or complex [-]
        Factor of each received signal, which beamformers do not know; see `flawed`.
    layout : tuple of int
        Elements along each axis of a regular array, the last axis running fastest; empty for irregular arrays.

    Raises
    ------
    ValueError
        If there are no elements, shapes disagree, a number is not finite, a normal or along is zero or the two are
        not perpendicular, the face has sizes that its pattern does not use, or no element has a weight.

    Notes
    -----
    Arrays are copied to float64 and read-only.
    """

    position: np.ndarray
    normal: np.ndarray
    along: np.ndarray
    length: float = 0.0
    height: float = 0.0
    pattern: Literal["omni", "rectangular", "circular"] = "omni"
    floor: float = 0.0
    baffle: Literal["none", "hard", "soft", "cardioid"] = "none"
    weight: np.ndarray = field(default_factory=lambda: np.ones(()))
    delay: np.ndarray = field(default_factory=lambda: np.zeros(()))
    channel: np.ndarray = field(default_factory=lambda: np.ones((), complex))
    layout: tuple[int, ...] = ()

    def __post_init__(self):
        self._set("position", positions_of(self.position))
        elements = self.elements
        for name, wanted in (("normal", (elements, 3)), ("along", (elements, 3)), ("weight", (elements,)),
                             ("delay", (elements,))):
            value = as_numbers(name, getattr(self, name))
            try:
                value = np.broadcast_to(value, wanted)
            except ValueError:
                raise ValueError(f"array: {name} has shape {value.shape}, but {elements} elements need "
                                 f"{wanted}.") from None
            refuse(~np.isfinite(value.reshape(elements, -1)).all(axis=1), name, value, "give finite numbers")
            if name in ("normal", "along"):
                size = np.linalg.norm(value, axis=1, keepdims=True)
                refuse(size[:, 0] == 0, name, value, "give a direction")
                value = value / size
            self._set(name, value)
        channel = np.asarray(self.channel, complex)
        if channel.shape not in ((), (elements,)) or not np.isfinite(channel).all():
            raise ValueError(f"array: channel has shape {channel.shape} for {elements} elements; give each a finite "
                             "complex number, or one to all.")
        self._set("channel", np.broadcast_to(channel, (elements,)))
        tilt = np.abs(np.sum(self.normal * self.along, axis=1))
        refuse(tilt > SQUARE, "along", self.along, "it must be perpendicular to the element's normal")
        if not self.working.any():
            raise ValueError("array: no element has a weight; give at least one a weight other than 0.")
        if self.layout and np.prod(self.layout) != elements:
            raise ValueError(f"array: layout {self.layout} does not hold {elements} elements.")
        check_face(self.length, self.height, self.pattern, self.baffle, self.floor)

    def _set(self, name: str, value: np.ndarray) -> None:
        value = np.array(value)
        value.flags.writeable = False
        object.__setattr__(self, name, value)

    # ---- properties

    @property
    def elements(self) -> int:
        """Number of elements, failed ones included."""
        return len(self.position)

    @property
    def working(self) -> np.ndarray:
        """Return True for elements that have a weight, bool (E,)."""
        return self.weight != 0

    @property
    def flawless(self) -> bool:
        """Return True if the channels of all elements are right."""
        return bool(np.all(self.channel == 1))

    @property
    def radius(self) -> float:
        """Largest distance of an element from the array's centre [m]."""
        return float(np.max(np.linalg.norm(self.position, axis=1)))

    def pitch(self) -> float:
        """Return the spacing of a uniform line [m].

        Raises
        ------
        ValueError
            If there is only one element, two coincide, or they do not lie in order on a straight line at one
            spacing.
        """
        if self.elements < 2:
            raise ValueError("array: a single element has no pitch; use at least two elements.")
        order = np.lexsort(self.position.T)
        same = np.flatnonzero(~np.diff(self.position[order], axis=0).any(axis=1))[:1]
        if same.size:
            first, second = sorted(order[same[0]:same[0] + 2])
            raise ValueError(f"array: elements {first} and {second} are both at {self.position[first]}, so there is no "
                             "pitch; move one of them.")
        step = (self.position[-1] - self.position[0]) / (self.elements - 1)
        pitch = float(np.linalg.norm(step))
        off = np.linalg.norm(self.position - self.position[0] - np.arange(self.elements)[:, None] * step, axis=1)
        worst = int(np.argmax(off))
        if off[worst] > EVEN * pitch:
            raise ValueError(f"array: the elements do not stand at one pitch on a line (element {worst} is "
                             f"{off[worst]:.3g} m off its place at a pitch of {pitch:.3g} m); use a line_array, or a "
                             "beamformer for any positions.")
        return pitch

    def faces(self) -> list[Face]:
        """Group elements that look the same way.

        Returns
        -------
        list of Face
            Every element is in one of them.
        """
        # Rounded, so that elements turned by the same angle in different ways still share a face.
        looks = np.hstack([self.normal, self.along]).round(12) + 0.0
        _, first, face = np.unique(looks, axis=0, return_index=True, return_inverse=True)
        return [Face(np.flatnonzero(face.ravel() == k), self.normal[e], self.along[e]) for k, e in enumerate(first)]

    def element_pressure(self, direction: Triple, wavelength: Numbers, normal: Triple, along: Triple) -> Numbers:
        """Return the pressure pattern of an element by its face's normal and along, see `element_patterns`.

        Parameters
        ----------
        direction : array (..., 3) or three Dr.Jit arrays [-]
            Unit vectors, body frame.
        wavelength : float [m]
        normal, along : array (..., 3) or three numbers or Dr.Jit arrays [-]

        Returns
        -------
        array (...) or Dr.Jit array [-]
        """
        return element_pressure(direction, wavelength, normal, along, length=self.length, height=self.height,
                                floor=self.floor, pattern=self.pattern, baffle=self.baffle)

    # ---- changed copies

    def shaded(self, *windows: str | tuple) -> Array:
        """Multiply the weights by windows.

        Parameters
        ----------
        *windows : str or tuple
            One window for all axes of the array, or one for each: along the array's axis first, then across its rows.
            Names and numbers as in `shading.window_weights`.

        Returns
        -------
        Array

        Raises
        ------
        ValueError
            If a window is unknown, or the elements have no regular order.
        """
        if not self.layout:
            raise ValueError("array: its elements stand in no regular order, so a window has no meaning; give each "
                             "element its weight instead.")
        if len(windows) not in (1, len(self.layout)):
            raise ValueError(f"array: got {len(windows)} windows for {len(self.layout)} axes; give one, or one for "
                             "each axis.")
        windows = windows if len(windows) > 1 else windows * len(self.layout)
        weight = np.ones(())
        for window, elements in zip(windows, reversed(self.layout), strict=True):
            weight = np.multiply.outer(window_weights(window, elements), weight)
        return replace(self, weight=self.weight * weight.ravel())

    def steered(self, direction: str | ArrayLike, sound_speed: float) -> Array:
        """Add the delays that steer the array towards a distant point.

        Parameters
        ----------
        direction : str or array (3,) [-]
            Body frame; a name of `axes.AXES`, or a vector of any length (see `axes.body_direction`).
        sound_speed : float [m/s]
            At the array.

        Returns
        -------
        Array
        """
        towards = axis_vector("steering direction", direction)
        return replace(self, delay=self.delay + self.position @ towards / checked_speed(sound_speed))

    def focused(self, point: ArrayLike, sound_speed: float) -> Array:
        """Add the delays that focus the array on a point.

        Parameters
        ----------
        point : array (3,) [m]
            Body frame, from the array's centre.
        sound_speed : float [m/s]
            At the array.

        Returns
        -------
        Array
        """
        point = vector_of("point to focus on", point)
        nearer = np.linalg.norm(point) - np.linalg.norm(point - self.position, axis=1)
        return replace(self, delay=self.delay + nearer / checked_speed(sound_speed))

    def failing(self, indices: ArrayLike) -> Array:
        """Return the array with failed elements, whose weight becomes 0.

        Parameters
        ----------
        indices : int or array of int (K,)
            Numbers of the elements, from 0.

        Returns
        -------
        Array

        Raises
        ------
        ValueError
            If an element does not exist, or all have failed.
        """
        indices = np.atleast_1d(indices)
        if indices.size and not np.issubdtype(indices.dtype, np.integer):
            raise ValueError(f"array: failed elements are {indices.tolist()}; give whole numbers from 0.")
        outside = indices[(indices < 0) | (indices >= self.elements)]
        if outside.size:
            raise ValueError(f"array: element {outside[0]} is to fail, but there are {self.elements}; give numbers "
                             f"from 0 to {self.elements - 1}.")
        weight = self.weight.copy()
        weight[indices.astype(int)] = 0.0
        return replace(self, weight=weight)

    def jittered(self, rms: float, seed: int = 0) -> Array:
        """Return the array with random position errors, as from mounting.

        Parameters
        ----------
        rms : float [m]
            Standard deviation of the Gaussian error of each coordinate.
        seed : int
            Same seed, same errors.

        Returns
        -------
        Array
        """
        if not (np.isfinite(rms) and rms >= 0):
            raise ValueError(f"array: the rms of position errors is {rms} m; give a finite length of at least 0.")
        error = np.random.Generator(np.random.Philox(seed)).standard_normal(self.position.shape)
        return replace(self, position=self.position + rms * error)

    def flawed(self, rms: float, seed: int | None = None) -> Array:
        """Return the array with random errors of its receivers, which fill the side lobes of beams; see `channels`.

        Parameters
        ----------
        rms : float [-]
            Standard deviation of their Gaussian errors, of amplitude and of phase [rad].
        seed : int or None
            Same seed, same errors; by default those of all arrays of as many receivers.

        Returns
        -------
        Array

        Notes
        -----
        The elements of a regular array that stand at one place along its axis, in different rows, share a receiver.
        The array is calibrated: its beam is right on the axis.
        """
        if not 0 <= rms <= 1:
            raise ValueError(f"array: the rms of its receivers' errors is {rms}; give a number from 0 to 1.")
        columns = self.layout[-1] if len(self.layout) == 2 else self.elements
        channel = np.tile(flawed(np.ones((1, columns)), rms, seed), self.elements // columns)
        size = np.abs(self.weight)[None]
        return replace(self, channel=channel[0] * (size.sum() / (channel * size).sum()))

    def moved(self, offset: ArrayLike) -> Array:
        """Move the array by an offset (3,) [m] in the body frame, away from where the track leads."""
        return replace(self, position=self.position + vector_of("offset", offset))

    def centred(self) -> Array:
        """Move the array so that the mean of its positions is its centre."""
        return self.moved(-self.position.mean(axis=0))
