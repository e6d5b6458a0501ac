"""Parameters of element signals by name: their values at the start, runs with others, and the motions that they cause.

=====================  =========  ==============  ==============================================================
name                   shape      unit            what it is
=====================  =========  ==============  ==============================================================
`S.tx_position`        (T, 3)     m               of transmit elements, body frame
`S.rx_position`        (E, 3)     m               of receive elements
`S.tx_weight`          (T,)       1               of what they send; magnitudes are made to add to 1
`S.tx_delay`           (T,)       s               by which they send later
`S.rx_delay`           (E,)       s               by which receivers' signals are later
`S.rx_gain`            (E, 2)     1               real and imaginary part of what receivers make of their signals
`S.position_offset`    (P, 3)     m               of the platform at each ping, scene coordinates
`S.attitude_offset`    (P, 3)     rad             of heading, pitch and roll
`N.position`           (3,)       m               of the point target N
`N.target_strength_db` ()         dB re 1 m²      of one that scatters alike at all frequencies and directions
=====================  =========  ==============  ==============================================================

S -> id of the sensor, P -> pings of the model.
"""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mitsonar.device.spelling import meant
from mitsonar.scene.geometry import Target
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.motion.track import Track, rotation_matrix
from mitsonar.survey.pressure.array_survey import ArraySurvey

from ..model import Values
from .levers import Motion

UNITS = {"tx_position": "m", "rx_position": "m", "tx_weight": "1", "tx_delay": "s", "rx_delay": "s", "rx_gain": "1",
         "position_offset": "m", "attitude_offset": "rad", "position": "m", "target_strength_db": "dB re 1 m²"}
RECEIVING, STRENGTHENING = ("rx_delay", "rx_gain"), ("tx_weight", "target_strength_db")
MOVING = tuple(name for name in UNITS if name not in (*RECEIVING, *STRENGTHENING))
NEPERS_PER_DB = np.log(10) / 20
ANGLE_STEP = 1e-5                  # [rad] of differences of rotations, in float64


@dataclass(frozen=True, kw_only=True, eq=False)
class Altered:
    """A run with other values."""

    survey: ArraySurvey
    targets: list[Target]
    gain: np.ndarray  # (E,): of the receivers' channels


class ElementParameters:
    """Parameters of the element signals of a run."""
    # offsets (P, 3) [rad]

    def __init__(self, survey: ArraySurvey, keys: Sequence[str], *, sensor: str, pings: Sequence[int],
                 offsets: tuple[np.ndarray, np.ndarray] | None = None):
        self._offsets = (np.zeros((len(pings), 3)), np.zeros((len(pings), 3))) if offsets is None else offsets
        self.survey, self.pings, self._sensor = survey, [int(ping) for ping in pings], sensor
        self.targets = survey.geometry.targets()
        shapes = [shape for _, shape, *_ in survey.geometry.meshes if hasattr(shape, "target_strength_db")]
        self._names = [shape.id() for shape in shapes]
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
        """Values of all parameters that there are."""
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
        """Return values as float64 arrays of their shapes, with those of the start, or zeros, for what is left out."""
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
        """Return the run with values as `checked` gives them."""
        survey = self.survey
        transmit = _replaced(survey.transmit, position=self._of(values, "tx_position"),
                             weight=self._of(values, "tx_weight"), delay=self._of(values, "tx_delay"))
        receive = _replaced(survey.receive, position=self._of(values, "rx_position"),
                            delay=self._of(values, "rx_delay"))
        place, turn = (None if (value := self._of(values, name)) is None else value - offset for name, offset in
                       zip(("position_offset", "attitude_offset"), self._offsets))
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

    def _of(self, values: Mapping[str, np.ndarray], name: str) -> np.ndarray | None:
        return values.get(f"{self._sensor}.{name}")

    # ---- what needs to be known of them

    @property
    def moves(self) -> bool:
        """Return whether echoes come later by any."""
        return any(name.rpartition(".")[2] in MOVING for name in self.start)

    @property
    def strengthens(self) -> bool:
        """Return whether echoes get stronger by any."""
        return any(name.rpartition(".")[2] in STRENGTHENING for name in self.start)

    @property
    def receives(self) -> bool:
        """Return whether any is of the receivers' channels."""
        return any(name.rpartition(".")[2] in RECEIVING for name in self.start)

    def receivers(self, tangents: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Return what delays (E,) [s] and complex gains (E,) of the receivers' channels change by."""
        late, gain = self._of(tangents, "rx_delay"), self._of(tangents, "rx_gain")
        nothing = np.zeros(self.survey.receive.elements)
        return (nothing if late is None else late,
                nothing if gain is None else gain[:, 0] + 1j * gain[:, 1])

    def add_receivers(self, late: np.ndarray, gain: np.ndarray, into: dict[str, np.ndarray]) -> None:
        """Add the gradient by them: (E,), and complex (E,)."""
        if f"{self._sensor}.rx_delay" in into:
            into[f"{self._sensor}.rx_delay"] += late
        if f"{self._sensor}.rx_gain" in into:
            into[f"{self._sensor}.rx_gain"] += np.stack([np.real(gain), np.imag(gain)], 1)

    # ---- motions of one ping

    def motion(self, tangents: Mapping[str, np.ndarray], survey: ArraySurvey, number: int) -> Motion:
        """Return what moves at a ping, by its number among the model's, of a survey as `altered` gives it."""
        ping = self.pings[number]
        rotation, turns = _rotations(survey.track, ping)
        motion = Motion.none(receivers=survey.receive.elements, senders=survey.transmit.elements,
                             targets=len(self.targets))
        for name, into in (("rx_position", motion.rx), ("tx_position", motion.tx)):
            moved = self._of(tangents, name)
            if moved is not None:
                into += moved @ rotation.T
        place, turn = self._of(tangents, "position_offset"), self._of(tangents, "attitude_offset")
        if place is not None:
            motion.place[:] += place[number]
        if turn is not None:
            carried = np.einsum("k,kij->ij", turn[number], turns)
            motion.rx[:] += survey.receive.position @ carried.T
            motion.tx[:] += survey.transmit.position @ carried.T
        late, weight = self._of(tangents, "tx_delay"), self._of(tangents, "tx_weight")
        if late is not None:
            motion.tx_delay[:] += late
        if weight is not None:
            motion.tx_strength[:] += _relative(survey, ping) @ weight
        for which, name in enumerate(self._names):
            motion.target[which] += tangents.get(f"{name}.position", np.zeros(3))
            motion.target_strength[which] += NEPERS_PER_DB * tangents.get(f"{name}.target_strength_db", 0.0)
        return motion

    def add_gradient(self, motion: Motion, survey: ArraySurvey, number: int, into: dict[str, np.ndarray]) -> None:
        """Add the gradient by the parameters, of that by the motions of a ping: the transpose of `motion`."""
        ping = self.pings[number]
        rotation, turns = _rotations(survey.track, ping)
        parts = {"rx_position": motion.rx @ rotation, "tx_position": motion.tx @ rotation,
                 "tx_delay": motion.tx_delay}
        for name, part in parts.items():
            if f"{self._sensor}.{name}" in into:
                into[f"{self._sensor}.{name}"] += part
        if f"{self._sensor}.tx_weight" in into:
            into[f"{self._sensor}.tx_weight"] += motion.tx_strength @ _relative(survey, ping)
        if f"{self._sensor}.position_offset" in into:
            into[f"{self._sensor}.position_offset"][number] += motion.place
        if f"{self._sensor}.attitude_offset" in into:
            moment = (np.einsum("ei,ej->ij", motion.rx, survey.receive.position)
                      + np.einsum("ei,ej->ij", motion.tx, survey.transmit.position))
            into[f"{self._sensor}.attitude_offset"][number] += np.einsum("kij,ij->k", turns, moment)
        for which, name in enumerate(self._names):
            if f"{name}.position" in into:
                into[f"{name}.position"] += motion.target[which]
            if f"{name}.target_strength_db" in into:
                into[f"{name}.target_strength_db"] += NEPERS_PER_DB * motion.target_strength[which]


def _replaced(array: Array, **parts: np.ndarray | None) -> Array:
    given = {name: part for name, part in parts.items() if part is not None}
    return replace(array, **given) if given else array


def _displaced(track: Track, pings: list[int], place: np.ndarray | None, turn: np.ndarray | None) -> Track:
    """A track that is off its own at some pings."""
    position = np.array(track.position)
    angles = {name: np.array(getattr(track, name)) for name in ("heading", "pitch", "roll")}
    if place is not None:
        position[pings] += place
    if turn is not None:
        for which, name in enumerate(angles):
            angles[name][pings] += turn[:, which]
    return Track(time=track.time, position=position, **angles)


def _rotations(track: Track, ping: int) -> tuple[np.ndarray, np.ndarray]:
    """The rotation (3, 3) of a ping, body to scene, and its derivatives (3, 3, 3) by heading, pitch and roll."""
    angles = np.array([track.roll[ping], track.pitch[ping], track.heading[ping]])
    turns = [(rotation_matrix(*(angles + step)) - rotation_matrix(*(angles - step))) / (2 * ANGLE_STEP)
             for step in ANGLE_STEP * np.eye(3)[::-1]]
    return rotation_matrix(*angles), np.stack(turns)


def _relative(survey: ArraySurvey, ping: int) -> np.ndarray:
    """What elements' parts of a transmission change by relative to themselves, as weights do: (T, T).

    Magnitudes of weights are made to add to 1. One that does not send stays silent.
    """
    own, sent = survey.transmit.weight, survey.transmit_weight(ping)
    works = sent != 0
    inverse = np.divide(1.0, own, out=np.zeros(len(own)), where=works)
    return np.diag(inverse) - works[:, None] * np.where(works, np.sign(own), 0)[None] / np.abs(own[works]).sum()
