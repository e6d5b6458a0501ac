"""What sensors of all kinds of sonar share."""
import mitsuba as mi

from mitsonar.plugins.attributes import Attributes
from mitsonar.water.profile import FASTEST, SLOWEST

from .platform import read_route

LEVELS_DB = {"minimum": -200, "maximum": 300}     # what energies in float32 can hold


class SonarSensor(mi.Sensor):
    """A sonar in its water, on its route, with its film.

    A subclass says which kind of sonar it is and reads the attributes that no other kind has (`read`).

    Attributes
    ----------
    kind : str
        One of `mitsonar.survey.kinds.KINDS`.
    usual_pings : int
        How many, where the scene does not say.
    frequency : float [Hz]
        Set by `read`.
    water : Seawater
    route : Route
    sound_speed : float or None [m/s]
        At the sonar; None: the profile's there.
    noise : bool
        Whether the sea is heard.
    provenance : dict or None
        File, resolved text and parameters, told by `mitsonar.load_file`.
    loaded : dict or None
        What the scene held when it was loaded, likewise.
    """

    kind: str
    usual_pings = 400
    frequency: float

    def __init__(self, props):
        attributes = Attributes(props)
        self.provenance = self.loaded = None
        self.sound_speed = attributes.number("sound_speed", None, above=SLOWEST, below=FASTEST, unit="m/s")
        self.route = read_route(attributes, self.usual_pings)
        self.noise = attributes.boolean("noise", True)
        self.given_noise_level_db = attributes.number("noise_level_db", None, **LEVELS_DB)
        self.water = attributes.object(mi.Medium, None)
        if not hasattr(self.water, "profile"):
            raise attributes.error('it must hold the water it works in: <medium type="seawater"/>.')
        self.read(attributes)
        attributes.finish()
        super().__init__(props)
        if not hasattr(self.film(), "sampling"):
            raise attributes.error('it must hold the record it makes: <film type="sonar_film"/>.')

    def read(self, attributes: Attributes) -> None:
        """Read what this kind of sonar alone has."""
        raise NotImplementedError

    def noise_level_db(self) -> float:
        """Ambient noise spectrum level [dB re 1 µPa²/Hz] at the sonar's frequency."""
        if self.given_noise_level_db is not None:
            return self.given_noise_level_db
        return self.water.noise_level_db(self.frequency)

    # ---- what Mitsuba asks of a sensor that no camera ray leaves

    def traverse(self, callback):
        super().traverse(callback)

    def sample_ray(self, time, wavelength_sample, position_sample, aperture_sample, active=True):
        raise ValueError(f"a sonar ({self.kind}) sends sound; render it with the integrator sonar_path")

    def bbox(self):
        return mi.ScalarBoundingBox3f()

    def to_string(self):
        return f"{type(self).__name__}[{self.frequency / 1000:g} kHz, {self.route.pings} pings]"
