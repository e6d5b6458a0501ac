"""Base classes of the sensors of all kinds of sonar."""
from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NoReturn

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload
from mitsonar.device.chance import pass_seed, sonar_seed
from mitsonar.io.scene_files import scenes
from mitsonar.sonar.arrays.array import Array
from mitsonar.survey.sensor import Film, Sensor, Water, slowest_speed
from mitsonar.survey.voyage import Route
from mitsonar.units import hertz_from_khz, power_from_db
from mitsonar.water.profile import FASTEST, SLOWEST

from ..attributes import Attribute, Attributes, Boolean, Group, Integer, Nested, Number
from .element_keys import ElementKeys
from .platform import OF_THE_TRACK, read_route

if TYPE_CHECKING:
    from mitsonar.imaging.recorder import Recorder

    from ..films.sonar_film import SonarFilm
    from ..media.seawater import Seawater

LOWEST_DB, HIGHEST_DB = -200, 300                 # range of energies in float32
LOUDEST_FLOOR_DB = -3.0                           # of diffuse side lobes

SOUND_SPEED = Number("sound_speed", default=None, above=SLOWEST, below=FASTEST, unit="m/s", otherwise="the profile's",
                     text="sound speed at the sonar, which converts time to slant range; from a profile, the speed at "
                          "the track's mean depth")
NOISE = (
    Boolean("noise", default=True,
            text="ambient noise in the receivers' band and beams, coherent between close elements"),
    Number("noise_level_db", default=None, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB re 1 µPa²/Hz",
           otherwise="the water's", text="spectrum level of that noise"),
)
PASS = Integer("pass", default=None, minimum=0, maximum=1_000_000,
               otherwise="0, or that of the sonar whose track it shares",
               text="number of the pass over the same ground; between passes, scatterers stay as coherent as the "
                    "`coherence` of their material states, and noise and water differ")
SELF_NOISE = Number("self_noise_db", default=None, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB re 1 µPa²/Hz",
                    text="self-noise of each receiver")
VERTICAL_SIDELOBE = Number(
    "vertical_sidelobe_db", minimum=LOWEST_DB, maximum=LOUDEST_FLOOR_DB, unit="dB",
    text="mean level of the diffuse side lobes across the fan, of each face, one way, relative to its axis: it fills "
         "the nulls between side lobes, which are black arcs otherwise; -20 to -30")

RECEIVE_FLAWS = Number(
    "receive_flaws", default=0.0, minimum=0, maximum=1,
    text="rms error of each receiver's amplitude [1] and phase [rad], which beamforming does not correct: diffuse side "
         "lobes of twice its square over the number of receivers of a row; 0.1 to 0.3")
NESTED = (
    Nested("medium", default=None, otherwise="needed", text="the water around the sonar, a `seawater`"),
    Nested("film", default=None, otherwise="needed", text="the record of the sonar, a `sonar_film`"),
    Nested("sensor", default=None,
           text="another sonar, by `<ref>`: this sonar pings at the same places and times, and takes no attribute of "
                "the track except `offset`; its last echo must arrive before the next ping of the other sonar"),
)


class SonarSensor(mi.Sensor):
    """A sonar in its water, on its route, with its film.

    A subclass has a `kind`, declares its attributes, and reads those that are its own (`read`).
    """
    # sound_speed [m/s]; position_offset, attitude_offset (3 pings,) [m], [rad]

    follows_offsets = True             # whether a run uses the offsets of the track besides its trajectory
    two_sided = False                  # whether the sonar looks to both sides
    recorder: Recorder | None = None   # set by `read`; None: nothing is recorded but levels
    kind: str  # one of `mitsonar.survey.kinds.KINDS`
    declared: tuple[Attribute | Group, ...]  # attributes of the kind, `SOUND_SPEED`, `NOISE`, `NESTED`, route
    frequency: float  # [Hz]: set by `read`

    def __init__(self, props: mi.Properties) -> None:
        attributes = Attributes(props, self.declared)
        self.provenance: dict[str, object] | None = None
        self.loaded: dict[str, object] | None = None
        self.path: str | None = None
        self.sound_speed: float | None = attributes.sound_speed
        self.leader: SonarSensor | None = attributes.sensor
        self.route = read_route(attributes) if self.leader is None else self._shared(attributes)
        self.pass_number = self._pass_number(attributes)
        self.noise: bool = attributes.noise
        self.given_noise_level_db: float | None = attributes.noise_level_db
        self.water: Seawater = attributes.medium
        if not isinstance(self.water, Water):
            raise attributes.error('it must hold the water it works in: <medium type="seawater"/>.')
        if not isinstance(attributes.film, Film):
            raise attributes.error('it must hold the record it makes: <film type="sonar_film"/>.')
        self.route = replace(self.route, tide=self.water.tide)
        self.read(attributes)
        self.elements = self.element_keys()
        self.rows = self.route.pings if self.route.bounded else 1
        self.position_offset, self.attitude_offset = (upload(mi.Float64, np.zeros(3 * self.rows)) for _ in range(2))
        super().__init__(props)
        self._check_in_time(attributes)

    def _shared(self, attributes: Attributes) -> Route:
        """Return the route of another sonar with the offset of this one."""
        leader = self.leader
        if not isinstance(leader, SonarSensor) or "sector_scan" in (self.kind, leader.kind):
            raise attributes.error("the nested <sensor> is the sonar whose track it shares; neither of the two may be "
                                   "a sector_scan: name a sidescan or an array by <ref>.")
        if written := attributes.given(*OF_THE_TRACK):
            raise attributes.error(f"{', '.join(written)} and a nested <sensor> are both given; the track is that of "
                                   f'"{leader.id()}", leave one of them out.')
        # as fast as the range of the leader allows: the range of this sonar must not change their places
        interval = None if leader.route.ping_rate else leader.route.interval or _shortest(leader)
        offset = attributes.offset if attributes.given("offset") else leader.route.offset
        return replace(leader.route, interval=interval, offset=offset)

    def _pass_number(self, attributes: Attributes) -> int:
        """Return the number as written, or that of the sonar whose track is shared; 0 for kinds without passes."""
        written = getattr(attributes, "pass", None)
        if written is not None:
            return written
        return 0 if self.leader is None else self.leader.pass_number

    def _check_in_time(self, attributes: Attributes) -> None:
        """Refuse a range whose last echo arrives after the next ping of the sonar whose track is shared."""
        if self.leader is None or self.route.interval is None:
            return
        interval, needed = self.route.interval, _shortest(self)
        if needed > interval * (1 + 1e-9):
            raise attributes.error(f"echoes from the range of its film take {needed:.4f} s, and the pings of "
                                   f'"{self.leader.id()}", whose track it shares, come every {interval:.4f} s; give '
                                   "the track to the sonar of the longer range, or write its ping_rate_hz.")

    if TYPE_CHECKING:                  # refused otherwise by the constructor
        def film(self) -> SonarFilm: ...

    def own_seed(self, seed: int) -> int:
        """Return the seed of this sonar's rays, speckle and noise, different for each pass and each sonar of a track.
        """
        seed = pass_seed(seed, self.pass_number)
        return seed if self.leader is None else sonar_seed(seed, self.id())

    def read(self, attributes: Attributes) -> None:
        """Read the attributes of this kind of sonar."""
        # Mitsuba's classes have a metaclass of their own, so they cannot be abstract ones
        raise NotImplementedError(f"{type(self).__name__} lacks the method read")

    def read_transmission(self, attributes: Attributes) -> None:
        """Read preset, carrier, source level and self-noise."""
        self.preset = getattr(attributes, "preset", None)
        self.frequency = float(hertz_from_khz(attributes.frequency_khz))
        self.source_level_db, self.self_noise_db = attributes.source_level_db, read_self_noise_db(attributes)

    def look_directions(self) -> tuple[np.ndarray, np.ndarray | None]:
        """Return the directions that the sonar looks into, and where they end; see `mitsonar.survey.sensor.Sensor`."""
        if self.two_sided:
            return np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]]), np.zeros(2)
        return self.receive.normal[:1], None

    def noise_level_db(self) -> float:
        """Return the ambient noise spectrum level [dB re 1 µPa²/Hz] at the sonar's frequency."""
        if self.given_noise_level_db is not None:
            return self.given_noise_level_db
        return self.water.noise_level_db(self.frequency)

    def place_of(self, tag: str, name: str) -> str:
        """Return the beginning of an error: file and line where the scene writes an attribute."""
        return f"{self.kind}: " if self.path is None else f"{scenes.place(self.path, tag, name)}: "

    # ---- methods that Mitsuba needs; no camera ray leaves a sonar

    def traverse(self, callback: mi.TraversalCallback) -> None:
        super().traverse(callback)
        callback.put("medium", self.water, mi.ParamFlags.NonDifferentiable)
        if self.elements is not None:
            self.elements.traverse(callback)
        if self.follows_offsets:
            callback.put("position_offset", self.position_offset, mi.ParamFlags.Differentiable)
            callback.put("attitude_offset", self.attitude_offset, mi.ParamFlags.Differentiable)

    def parameters_changed(self, keys: list[str]) -> None:
        super().parameters_changed(keys)
        if self.elements is not None:
            self.take_elements(*self.elements.changed())
        errors = {}
        for name in ("position", "attitude"):
            offset = dr.detach(getattr(self, f"{name}_offset")).numpy()
            if len(offset) != 3 * self.rows or not np.all(np.isfinite(offset)):
                raise ValueError(f"{self.kind}: {name}_offset has {len(offset)} numbers, finite or not; give "
                                 f"{3 * self.rows} finite numbers, three for each ping.")
            errors[f"{name}_error"] = offset.reshape(-1, 3).copy() if np.any(offset) else None
        self.route = replace(self.route, **errors)

    def element_keys(self) -> ElementKeys | None:
        """Return the numbers of the elements that can be changed; None if there are none."""
        return None

    def take_elements(self, transmit: Array, receive: Array) -> None:
        """Use other elements from now on; for kinds with `element_keys`."""
        self.transmit, self.receive = transmit, receive

    def sample_ray(self, *_: Any, **__: Any) -> NoReturn:
        raise ValueError(f"a sonar ({self.kind}) sends sound; render it with the integrator sonar_path")

    def bbox(self) -> mi.ScalarBoundingBox3f:
        return mi.ScalarBoundingBox3f()

    def to_string(self) -> str:
        return f"{type(self).__name__}[{self.frequency / 1000:g} kHz, {self.route.pings} pings]"


class FanSensor(SonarSensor):
    """A sonar with one transmit and one receive array, whose picture is a fan of beams."""

    picture: str | None  # as written, or "elements"; set by `read`
    fan_width: float  # [rad]: set by `read`
    delays_from_file: tuple[bool, bool] = (False, False)

    def look_directions(self) -> tuple[np.ndarray, np.ndarray | None]:
        """Return the middle and both ends of the fan; see `SonarSensor.look_directions`."""
        from mitsonar.imaging.fan import fan_directions  # a scene is loaded without what pictures need

        return fan_directions(self.receive, 3, self.fan_width)[1], None

    def element_keys(self) -> ElementKeys:
        """Note picture and steering as loaded, and return the numbers of the elements."""
        self.written_picture = self.picture
        self.steering_delays = self.transmit.delay, self.receive.delay
        return ElementKeys(self.kind, self.transmit, self.receive)

    def take_elements(self, transmit: Array, receive: Array) -> None:
        """Use other elements; with receive delays other than those of steering, the picture is made of signals."""
        self.picture = self.written_picture
        if not np.array_equal(receive.delay, self.steering_delays[1]):
            if self.picture == "beams":
                raise ValueError(f"{self.kind}: rx_delay is written, but picture `beams` ignores delays of receivers; "
                                 "leave picture out, or make it elements.")
            self.picture = "elements"
        super().take_elements(transmit, receive)


def read_self_noise_db(attributes: Attributes) -> float | None:
    """Return the receivers' noise [dB re 1 µPa²/Hz], None for the faintest; a preset's counts only beside `noise`."""
    level, wanted = attributes.self_noise_db, attributes.noise or attributes.given("self_noise_db")
    return level if wanted and level is not None and level > LOWEST_DB else None


def power_of(level_db: float) -> float:
    """Return a power; 0 for the faintest level."""
    return float(power_from_db(level_db)) if level_db > LOWEST_DB else 0.0


def _shortest(sonar: Sensor) -> float:
    """Return the time [s] until the last echo of a ping arrives."""
    return float(sonar.film().window(slowest_speed(sonar))[0][1])
