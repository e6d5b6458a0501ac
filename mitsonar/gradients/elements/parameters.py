"""Hold parameters of element signals by name: start values, surveys with other values, and the motions they cause.

=====================  =========  ==============  ==============================================================
name                   shape      unit            meaning
=====================  =========  ==============  ==============================================================
`S.tx_position`        (T, 3)     m               transmit elements, body frame
`S.rx_position`        (E, 3)     m               receive elements, body frame
`S.tx_weight`          (T,)       1               transmit weights; their magnitudes are scaled to add to 1
`S.tx_delay`           (T,)       s               transmit delays
`S.rx_delay`           (E,)       s               receive delays
`S.rx_gain`            (E, 2)     1               real and imaginary part of the receivers' gains
`S.position_offset`    (P, 3)     m               offset of the platform at each ping, scene coordinates
`S.attitude_offset`    (P, 3)     rad             offset of heading, pitch and roll
`N.position`           (3,)       m               position of the point target N
`N.target_strength_db` ()         dB re 1 m²      strength of a target alike at all frequencies and directions
=====================  =========  ==============  ==============================================================

S -> id of the sensor, P -> pings of the model.
"""
from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, picked
from mitsonar.device.rotations import rotation_matrix, rotation_slopes
from mitsonar.device.spelling import meant
from mitsonar.scene.geometry import Target
from mitsonar.scene.protocols import target_shape
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.motion.track import Track
from mitsonar.survey.pressure.array_survey import ArraySurvey

from ..model import Values
from .levers import Motion

UNITS = {"tx_position": "m", "rx_position": "m", "tx_weight": "1", "tx_delay": "s", "rx_delay": "s", "rx_gain": "1",
         "position_offset": "m", "attitude_offset": "rad", "position": "m", "target_strength_db": "dB re 1 m²"}
RECEIVING, STRENGTHENING = ("rx_delay", "rx_gain"), ("tx_weight", "target_strength_db")
MOVING = tuple(name for name in UNITS if name not in (*RECEIVING, *STRENGTHENING))
OF_PINGS = "position_offset", "attitude_offset"       # a scene names them for all pings, a model for its own
NEPERS_PER_DB = float(np.log(10)) / 20
ValueT = TypeVar("ValueT")


@dataclass(frozen=True, kw_only=True, eq=False)
class Altered:
    """Hold a survey with other values; `gain` (E,), complex, is that of the receivers' channels."""

    survey: ArraySurvey
    targets: list[Target]
    gain: np.ndarray


class ElementParameters:
    """Parameters of element signals by the keys above, for one sensor and some pings.

    `offsets` of position (P, 3) [m] and attitude (P, 3) [rad] are already part of the survey's track.
    """

    def __init__(self, survey: ArraySurvey, keys: Sequence[str], *, sensor: str, pings: Sequence[int],
                 offsets: tuple[np.ndarray, np.ndarray] | None = None):
        self._offsets = (np.zeros((len(pings), 3)), np.zeros((len(pings), 3))) if offsets is None else offsets
        self.survey, self.pings, self._sensor = survey, [int(ping) for ping in pings], sensor
        geometry = survey.world.still
        self.targets = geometry.targets()
        self._names = [shape.id() for _, shape, *_ in geometry.meshes if target_shape(shape) is not None]
        known = self._known()
        if f"{sensor}.rx_weight" in keys:
            raise ValueError(f"{sensor}.rx_weight shades beams, and element signals do not depend on it; take "
                             f"{sensor}.rx_gain")
        for key in keys:
            if key not in known:
                raise ValueError(f"{key!r} is no parameter of element signals{meant(key, list(known))}; there are "
                                 f"{', '.join(known)}")
        if len(set(keys)) < len(keys) or not keys:
            raise ValueError(f"{len(keys)} parameters were asked for, {len(set(keys))} of them different; name each "
                             "once, and at least one")
        self.start = {key: known[key] for key in keys}
        self.units = {key: UNITS[key.rpartition(".")[2]] for key in keys}

    def _known(self) -> dict[str, np.ndarray]:
        """Return the values of all existing parameters."""
        transmit, receive = self.survey.transmit, self.survey.receive
        of_sensor = {"tx_position": transmit.position, "rx_position": receive.position, "tx_weight": transmit.weight,
                     "tx_delay": transmit.delay, "rx_delay": receive.delay,
                     "rx_gain": np.tile([1.0, 0.0], (receive.elements, 1)),
                     "position_offset": self._offsets[0], "attitude_offset": self._offsets[1]}
        known = {f"{self._sensor}.{name}": np.array(value, float) for name, value in of_sensor.items()}
        for name, target in zip(self._names, self.targets):
            if target.scattering is None:
                known[f"{name}.target_strength_db"] = np.array(float(target.strength_db))
            known[f"{name}.position"] = np.array(target.position, float)
        return known

    def checked(self, values: Values, whole: bool = True) -> dict[str, np.ndarray]:
        """Return values as float64 arrays, with start values, or zeros, for parameters that are left out."""
        for name in values:
            if name not in self.start:
                raise ValueError(f"{name!r} is none of the model's parameters{meant(name, list(self.start))}; it has "
                                 f"{', '.join(self.start)}")
        found = {}
        for name, start in self.start.items():
            value = np.asarray(values[name], float) if name in values else start if whole else np.zeros(start.shape)
            if value.shape != start.shape:
                raise ValueError(f"{name} has the shape {value.shape}; give it {start.shape}")
            if not np.isfinite(value).all():
                raise ValueError(f"{name} has values that are not finite; give numbers")
            found[name] = value
        return found

    # ---- runs with other values

    def altered(self, values: Mapping[str, np.ndarray]) -> Altered:
        """Return the survey with values from `checked`; ValueError if no array or track can be made of them."""
        survey = self.survey
        transmit = _replaced(survey.transmit, position=self._of(values, "tx_position"),
                             weight=self._of(values, "tx_weight"), delay=self._of(values, "tx_delay"))
        receive = _replaced(survey.receive, position=self._of(values, "rx_position"),
                            delay=self._of(values, "rx_delay"))
        place, turn = (None if (value := self._of(values, name)) is None else value - offset for name, offset in
                       zip(OF_PINGS, self._offsets))
        passage = survey.passage
        if place is not None or turn is not None:
            track = _displaced(passage.voyage.track, self.pings, place, turn)
            passage = replace(passage, voyage=replace(passage.voyage, track=track))
        targets = []
        for name, target in zip(self._names, self.targets):
            position = values.get(f"{name}.position", target.position)
            strength = float(values.get(f"{name}.target_strength_db", target.strength_db))
            targets.append(target._replace(position=np.asarray(position, float), strength_db=strength))
        gain = self._of(values, "rx_gain")
        return Altered(
            survey=replace(survey, transmit=transmit, receive=receive, passage=passage), targets=targets,
            gain=np.ones(receive.elements, complex) if gain is None else gain[:, 0] + 1j * gain[:, 1])

    def _of(self, values: Mapping[str, ValueT], name: str) -> ValueT | None:
        return values.get(f"{self._sensor}.{name}")

    # ---- motions of one ping

    def has(self, names: Collection[str]) -> bool:
        """Return True if any parameter is of one of these kinds."""
        return any(name.rpartition(".")[2] in names for name in self.start)

    def motion(self, tangents: Mapping[str, mi.Float64], survey: ArraySurvey, number: int) -> Motion:
        """Return the motion at a ping, by its number in the model, for a survey from `altered`.

        The motion is linear in the tangents, flat Float64, and attached to them.
        """
        lib = arrays_of(mi.Float)
        V, ping, transmit, receive = lib.Array3f64, self.pings[number], survey.transmit, survey.receive

        def numbers(name: str, kind: type, count: int) -> Any:      # not by `unravel`: a second one's gradient is lost
            value = self._of(tangents, name)
            if value is None:
                return dr.zeros(kind, count)
            return value if kind is lib.Float64 else dr.gather(kind, value, dr.arange(lib.UInt32, count))

        def on_device(array: np.ndarray, kind: type) -> Any:
            found = kind(np.ascontiguousarray(array, float))
            dr.make_opaque(found)
            return found

        def at_targets(name: str, count: int) -> Any:
            return dr.concat([tangents.get(f"{target}.{name}", dr.zeros(lib.Float64, count)) for target in self._names]
                             or [dr.zeros(lib.Float64, count)])

        place, turn = (picked(numbers(name, V, len(self.pings)), lib.UInt32(number)) for name in OF_PINGS)
        rotation, *turns = (on_device(matrix, lib.Matrix3f64) for matrix in _rotations(survey.track, ping))
        carried = turns[0] * turn.x + turns[1] * turn.y + turns[2] * turn.z
        rx, tx = (rotation @ numbers(name, V, array.elements) + carried @ on_device(array.position.T, V)
                  for name, array in (("rx_position", receive), ("tx_position", transmit)))
        # magnitudes of weights are made to add to 1; an element that does not send stays silent
        own, works = transmit.weight, survey.transmit_weight(ping) != 0
        weight = numbers("tx_weight", lib.Float64, len(own))
        inverse = on_device(np.divide(1.0, own, out=np.zeros(len(own)), where=works), lib.Float64)
        share = on_device(np.where(works, np.sign(own), 0) / np.abs(own[works]).sum(), lib.Float64)
        sends = on_device(works.astype(float), lib.Float64)
        return {"place": place, "rx": rx, "tx": tx, "tx_delay": numbers("tx_delay", lib.Float64, transmit.elements),
                "tx_strength": inverse * weight - sends * dr.sum(share * weight),
                "target": dr.gather(V, at_targets("position", 3), dr.arange(lib.UInt32, max(1, len(self._names)))),
                "target_strength": NEPERS_PER_DB * at_targets("target_strength_db", 1),
                "rx_delay": numbers("rx_delay", lib.Float64, receive.elements),
                "rx_gain": numbers("rx_gain", lib.Array2f64, receive.elements)}


def _replaced(array: Array, **parts: np.ndarray | None) -> Array:
    given = {name: part for name, part in parts.items() if part is not None}
    return replace(array, **given) if given else array


def _displaced(track: Track, pings: list[int], place: np.ndarray | None, turn: np.ndarray | None) -> Track:
    """Return a track that is displaced and turned at some pings."""
    position = np.array(track.position)
    angles = {name: np.array(getattr(track, name)) for name in ("heading", "pitch", "roll")}
    if place is not None:
        position[pings] += place
    if turn is not None:
        for which, name in enumerate(angles):
            angles[name][pings] += turn[:, which]
    return Track(time=track.time, position=position, **angles)


def _rotations(track: Track, ping: int) -> list[np.ndarray]:
    """Return the rotation (3, 3) of a ping, body to scene, and its derivatives by heading, pitch and roll."""
    angles = track.roll[ping], track.pitch[ping], track.heading[ping]
    return [rotation_matrix(*angles), *rotation_slopes(*angles)]
