"""What sensors of all kinds of sonar share."""
from typing import Any, NoReturn

import mitsuba as mi

from mitsonar.water.profile import FASTEST, SLOWEST

from ..attributes import Attribute, Attributes, Boolean, Group, Nested, Number
from .platform import read_route

LOWEST_DB, HIGHEST_DB = -200, 300                 # what energies in float32 can hold

SOUND_SPEED = Number("sound_speed", default=None, above=SLOWEST, below=FASTEST, unit="m/s", otherwise="the profile's",
                     text="at the sonar, makes slant range of time; the profile's is that at the track's mean depth")
NOISE = (
    Boolean("noise", default=True, text="ambient noise in the receivers' band and beams, coherent between close "
                                        "elements"),
    Number("noise_level_db", default=None, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB re 1 µPa²/Hz",
           otherwise="the water's", text="spectrum level of that noise"),
)
SELF_NOISE = Number("self_noise_db", default=None, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB re 1 µPa²/Hz",
                    text="noise of each receiver by itself")
NESTED = (
    Nested("medium", default=None, otherwise="needed", text="a `seawater`, the water it works in"),
    Nested("film", default=None, otherwise="needed", text="a `sonar_film`, the record it makes"),
)


class SonarSensor(mi.Sensor):
    """A sonar in its water, on its route, with its film.

    A subclass says which kind of sonar it is and what it declares, and takes the attributes that no other kind has
    (`read`).

    Attributes
    ----------
    kind : str
        One of `mitsonar.survey.kinds.KINDS`.
    declared : tuple of Attribute or Group
        Those of the kind, `SOUND_SPEED`, `NOISE`, `NESTED` and the route's.
    frequency : float [Hz]
        Set by `read`.
    water : Seawater
    route : Route
    sound_speed : float or None [m/s]
        At the sonar; None: the profile's there.
    noise : bool
        Whether the sea's noise is added.
    provenance : dict or None
        File, resolved text and parameters, told by `mitsonar.load_file`.
    loaded : dict or None
        What the scene held when it was loaded, likewise.
    """

    kind: str
    declared: tuple[Attribute | Group, ...]
    frequency: float

    def __init__(self, props: mi.Properties) -> None:
        attributes = Attributes(props, self.declared)
        self.provenance = self.loaded = None
        self.sound_speed = attributes.sound_speed
        self.route = read_route(attributes)
        self.noise, self.given_noise_level_db = attributes.noise, attributes.noise_level_db
        self.water = attributes.medium
        if not hasattr(self.water, "profile"):
            raise attributes.error('it must hold the water it works in: <medium type="seawater"/>.')
        if not hasattr(attributes.film, "sampling"):
            raise attributes.error('it must hold the record it makes: <film type="sonar_film"/>.')
        self.read(attributes)
        super().__init__(props)

    def read(self, attributes: Attributes) -> None:
        """Take what this kind of sonar alone has."""
        # Mitsuba's classes have a metaclass of their own, so they cannot be abstract ones
        raise NotImplementedError(f"{type(self).__name__} lacks the method read")

    def noise_level_db(self) -> float:
        """Ambient noise spectrum level [dB re 1 µPa²/Hz] at the sonar's frequency."""
        if self.given_noise_level_db is not None:
            return self.given_noise_level_db
        return self.water.noise_level_db(self.frequency)

    # ---- what Mitsuba asks of a sensor that no camera ray leaves

    def traverse(self, callback: mi.TraversalCallback) -> None:
        super().traverse(callback)

    def sample_ray(self, *_: Any, **__: Any) -> NoReturn:
        raise ValueError(f"a sonar ({self.kind}) sends sound; render it with the integrator sonar_path")

    def bbox(self) -> mi.ScalarBoundingBox3f:
        return mi.ScalarBoundingBox3f()

    def to_string(self) -> str:
        return f"{type(self).__name__}[{self.frequency / 1000:g} kHz, {self.route.pings} pings]"
