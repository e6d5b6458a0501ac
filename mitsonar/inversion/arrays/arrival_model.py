"""Compute arrival times of echoes of point targets at elements of a moving array, and their derivatives.

    t = T(x_t, X) + T(X, x_e(t)),     x_t = x + R (r_t + l),     x_e(t) = x + D(t) + w t + A(t) R (r_e + l)
    dt = ((h_out - h_back)·dX - s_t·dx_t + s_e·(dx_e + t dw)) / (1 - s_e·v_e) + dd_e

T -> time of the exact eigenray, s -> its slowness at elements, h at the target, along the travel; x, R -> place and
attitude of the ping; D, A -> motion of the platform since (`sonar.trajectory`), w -> error of its velocity; l ->
``lever_arm`` of both arrays, body frame; d_e -> ``rx_delay`` of the receivers' channels. Rays are stationary (Fermat),
so that no other terms occur. Times measured with a replica of another Doppler factor are off by κ (∂t/∂x)·w, κ ->
`coupling` [s].
"""
from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mitsonar.device.rotations import rotated, rotation_matrix, rotation_slopes
from mitsonar.device.spelling import meant
from mitsonar.gradients.model import Values
from mitsonar.propagation.numpy_rays.eigenrays import eigenray
from mitsonar.propagation.returns.travel import REST, Travel
from mitsonar.sonar.motion.track import Track
from mitsonar.sonar.motion.trajectory import Recorded, Trajectory
from mitsonar.water.profile import SoundSpeedProfile

UNITS = {"rx_position": "m", "rx_delay": "s", "tx_position": "m", "lever_arm": "m", "position_offset": "m",
         "attitude_offset": "rad", "velocity_offset": "m/s", "target_position": "m"}
ITERATIONS = 4                     # of the arrival at a moving element: each is better by v / c
STEP = 1e-6                        # [s] of differences of the platform's motion, in float64


@dataclass(frozen=True, kw_only=True, eq=False)
class Arrivals:
    """Hold times and their derivatives."""

    time: np.ndarray  # (P, K, E) [s]: since each transmission
    jacobian: dict[str, np.ndarray]  # (P, K, E, ...): by each parameter, its own numbers last


class ArrivalModel:
    """Compute arrival times as a `ForwardModel`."""
    # receive (E, 3) [m]; transmit (3,) [m]; targets (K, 3) [m]; duration [s]

    def __init__(self, track: Track, receive: np.ndarray, transmit: np.ndarray, targets: np.ndarray,
                 profile: SoundSpeedProfile, *, duration: float, keys: Sequence[str] = tuple(UNITS)):
        self._track, self._profile, self._coupling = track, profile, 0.0
        receive, targets = (np.asarray(some, float) for some in (receive, targets))
        transmit = np.asarray(transmit, float)
        for name, value in (("receive", receive), ("targets", targets), ("transmit", transmit[None])):
            if value.ndim != 2 or value.shape[1] != 3 or not len(value) or not np.isfinite(value).all():
                raise ValueError(f"{name} has the shape {value.shape}; give three finite numbers of metres for each")
        for key in keys:
            if key not in UNITS:
                raise ValueError(f"{key!r} is no parameter of arrivals{meant(key, list(UNITS))}; there are "
                                 f"{', '.join(UNITS)}")
        self._latest: list = []            # values and their arrivals, which a fit asks for more than once
        pings = track.pings
        self.shape = pings, len(targets), len(receive)
        self._all = {"rx_position": receive, "rx_delay": np.zeros(len(receive)), "tx_position": transmit,
                     "lever_arm": np.zeros(3), "position_offset": np.zeros((pings, 3)),
                     "attitude_offset": np.zeros((pings, 3)), "velocity_offset": np.zeros((pings, 3)),
                     "target_position": targets}
        self.start = {key: self._all[key] for key in keys}
        self.units = {key: UNITS[key] for key in keys}
        self._velocity = np.zeros((pings, 3))
        if pings > 1:
            trajectory = Trajectory(lead=Recorded.through(track))
            ways = trajectory.during(track.time, duration)
            self._velocity = trajectory.rates(track.time)[0]
            self._ways = [Travel.within(d, r, duration) for d, r in zip(ways.displacement, ways.turn)]
        else:
            self._ways = [REST]

    def value(self, values: Values) -> np.ndarray:
        """Return the times (P K E,) [s]; see `ForwardModel.value`."""
        return self.arrivals(values).time.ravel()

    def linearised(self, values: Values) -> ArrivalJacobian:
        """Return the times with their Jacobian; see `ForwardModel.linearised`."""
        return ArrivalJacobian(self.arrivals(values), self.start)

    def coupled(self, coupling: float) -> ArrivalModel:
        """Return the same model, with errors of time by a ``coupling`` [s] to errors of the Doppler factor."""
        other = copy.copy(self)
        other._coupling = coupling
        return other

    def doppler(self) -> np.ndarray:
        """Return the two-way Doppler factors (P, K) of echoes, at the start."""
        slower = self.arrivals(self.start).jacobian["position_offset"] @ self._velocity[:, None, :, None]
        return 1 / (1 + slower[..., 0].mean(-1))

    def checked(self, values: Values) -> dict[str, np.ndarray]:
        """Return values of all parameters, with start values for those left out."""
        for name, value in values.items():
            if name not in self.start:
                raise ValueError(f"{name!r} is not a parameter of the model{meant(name, list(self.start))}; it has "
                                 f"{', '.join(self.start)}")
            if np.shape(value) != self.start[name].shape:
                raise ValueError(f"{name} has the shape {np.shape(value)}; give it {self.start[name].shape}")
        return {name: np.asarray(values.get(name, start), float) for name, start in self._all.items()}

    def arrivals(self, values: Values) -> Arrivals:
        """Return the times and their derivatives."""
        at = self.checked(values)
        if not self._latest or any(np.any(at[name] != value) for name, value in self._latest[0][0].items()):
            self._latest[:] = [(at, [self._of_ping(ping, at) for ping in range(self.shape[0])])]
        parts = self._latest[0][1]
        time = np.stack([part[0] for part in parts])
        if not np.isfinite(time).all():
            ping, target, element = np.argwhere(~np.isfinite(time))[0]
            raise ValueError(f"no ray leads from target {target} to element {element} at ping {ping}; leave it out")
        jacobian = {name: np.stack([part[1][name] for part in parts]) for name in UNITS}
        if self._coupling:
            slower = jacobian["position_offset"]
            time = time + self._coupling * np.sum(slower * at["velocity_offset"][:, None, None], -1)
            jacobian["velocity_offset"] = jacobian["velocity_offset"] + self._coupling * slower
        return Arrivals(time=time, jacobian={name: jacobian[name] for name in self.start})

    def _of_ping(self, ping: int, at: dict[str, np.ndarray]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return times (K, E) of a ping, and their derivatives."""
        track, way = self._track, self._ways[ping]
        place = track.position[ping] + at["position_offset"][ping]
        angles = np.array([track.roll[ping], track.pitch[ping], track.heading[ping]])
        angles = angles + at["attitude_offset"][ping][::-1]
        rotation, turns = rotation_matrix(*angles), rotation_slopes(*angles)
        targets, sender = at["target_position"], at["tx_position"] + at["lever_arm"]
        arms = at["rx_position"] + at["lever_arm"]
        out, leaves, meets = self._ray(place + rotation @ sender, targets)           # (K,), (K, 3), (K, 3)

        def elements(time: np.ndarray) -> tuple[np.ndarray, tuple]:
            """Return positions of elements at times (K, E), and the rotation of the array then."""
            moved, turned = np.stack(np.broadcast_arrays(*way.moved(time)), -1), way.turned(time)
            carried = rotated(tuple((arms @ rotation.T).T), turned)
            moved = moved + time[..., None] * at["velocity_offset"][ping]
            return place + moved + np.stack(np.broadcast_arrays(*carried), -1), turned

        time = np.repeat(2 * out[:, None], len(arms), 1)
        for _ in range(ITERATIONS):
            where, turned = elements(time)
            back, goes, comes = self._ray(targets[:, None], where)
            time = out[:, None] + back
        velocity = (elements(time + STEP)[0] - elements(time - STEP)[0]) / (2 * STEP)
        scale = 1 / (1 - np.sum(comes * velocity, -1))                                # (K, E)
        comes, goes = comes * scale[..., None], goes * scale[..., None]
        leaves, meets = leaves[:, None] * scale[..., None], meets[:, None] * scale[..., None]
        # slowness at reception, as the array was at the transmission
        seen = np.stack(np.broadcast_arrays(*rotated(tuple(np.moveaxis(comes, -1, 0)), turned, back=True)), -1)
        by_arm, by_sender = seen @ rotation, -leaves @ rotation
        jacobian = {"rx_position": by_arm, "rx_delay": np.ones_like(time), "tx_position": by_sender,
                    "lever_arm": by_arm + by_sender, "position_offset": comes - leaves, "target_position": meets - goes,
                    "velocity_offset": time[..., None] * comes,
                    "attitude_offset": np.stack([np.einsum("kei,ij,ej->ke", seen, turn, arms)
                                                 - np.einsum("kei,ij,j->ke", leaves, turn, sender) for turn in turns],
                                                -1)}
        return time + at["rx_delay"], jacobian

    def _ray(self, begin: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return times (...), and slowness (..., 3) [s/m] at both ends of rays between points (..., 3)."""
        apart = end[..., :2] - begin[..., :2]
        across = np.hypot(apart[..., 0], apart[..., 1])
        upper, lower = np.broadcast_arrays(-begin[..., 2], -end[..., 2])
        ray = eigenray(self._profile, upper, lower, across)
        heading = apart / np.maximum(across, 1e-12)[..., None]
        slow = [np.concatenate([heading * np.cos(angle)[..., None], -np.sin(angle)[..., None]], -1)
                / self._profile.at(depth)[..., None]
                for angle, depth in ((ray.launch_angle, upper), (ray.arrival_angle, lower))]
        return ray.travel_time, slow[0], slow[1]


class ArrivalJacobian:
    """Arrival times linearised about some values, as a `Linearised`."""
    # value (N,) [s]

    def __init__(self, arrivals: Arrivals, start: dict[str, np.ndarray]):
        self._arrivals, self._start = arrivals, start
        self.value = arrivals.time.ravel()

    def forward(self, tangents: Values) -> np.ndarray:
        """Return J v; see `Linearised.forward`."""
        total = np.zeros(self._arrivals.time.shape)
        for name, tangent in tangents.items():
            if name not in self._start or np.shape(tangent) != self._start[name].shape:
                raise ValueError(f"{name!r} of the shape {np.shape(tangent)} is no parameter of the model")
            total += np.sum(self._arrivals.jacobian[name] * _spread(name, np.asarray(tangent, float)), -1) \
                if name != "rx_delay" else np.asarray(tangent, float)
        return total.ravel()

    def backward(self, cotangent: np.ndarray) -> dict[str, np.ndarray]:
        """Return Jᵀ w; see `Linearised.backward`."""
        if np.shape(cotangent) != self.value.shape:
            raise ValueError(f"weights have the shape {np.shape(cotangent)}; give one for each of the "
                             f"{len(self.value)} times")
        weights = np.reshape(cotangent, self._arrivals.time.shape)
        found = {}
        for name, start in self._start.items():
            own = self._arrivals.jacobian[name]
            product = weights * own if name == "rx_delay" else weights[..., None] * own
            found[name] = product.sum(SUMMED[name]).reshape(start.shape)
        return found

    def dense(self) -> np.ndarray:
        """Return the whole Jacobian, (N, unknowns), parameters in their order."""
        pings, targets, elements = self._arrivals.time.shape
        columns = []
        for name in self._start:
            own = self._arrivals.jacobian[name]
            own = own[..., None] if name == "rx_delay" else own
            wide = {"ping": pings, "target": targets, "rx": elements}.get(OF[name])
            if wide is None:
                columns.append(own.reshape(-1, 3))
                continue
            whole = np.zeros((pings, targets, elements, wide, own.shape[-1]))
            index = np.arange(wide)
            if OF[name] == "ping":
                whole[index, :, :, index] = own
            elif OF[name] == "target":
                whole[:, index, :, index] = np.moveaxis(own, 1, 0)
            else:
                whole[:, :, index, index] = own
            columns.append(whole.reshape(pings * targets * elements, -1))
        return np.concatenate(columns, 1)


OF = {"rx_position": "rx", "rx_delay": "rx", "tx_position": "", "lever_arm": "", "position_offset": "ping",
      "attitude_offset": "ping", "velocity_offset": "ping", "target_position": "target"}
SUMMED = {name: {"rx": (0, 1), "": (0, 1, 2), "ping": (1, 2), "target": (0, 2)}[of] for name, of in OF.items()}


def _spread(name: str, tangent: np.ndarray) -> np.ndarray:
    """Return a tangent over (ping, target, element, axis)."""
    return {"rx": tangent, "": tangent, "ping": tangent[:, None, None] if tangent.ndim == 2 else tangent,
            "target": tangent[:, None] if tangent.ndim == 2 else tangent}[OF[name]]
