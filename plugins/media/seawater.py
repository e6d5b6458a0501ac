"""Seawater (`seawater`): sound speed against depth, absorption, ambient noise, volume scattering.

Sound speed is one of, in this order: ``profile``, ``cast``, ``sound_speed``; without any, a formula computes it from
``temperature`` and ``salinity``.

- ``profile``: table, depth [m] : sound speed [m/s], increasing depths; linear between, constant beyond.
- ``cast``: name of a file `mitsonar.io.casts` reads; its temperature and salinity, if it has them, set absorption.
- ``cast_sound_speed`` [file]: "file", or "teos-10" from the cast's temperature and salinity whatever the file gives.
- ``cast_extension`` [constant]: below the cast's deepest sample; "gradient" is mixed water at rising pressure.
- ``sound_speed``: one number [m/s].
- ``sound_speed_formula`` [teos-10]: of `mitsonar.water.sound_speed`, where none of those is given. Down to 6000 m, or
  as deep as the formula reaches (``medwin``: 1000 m); constant below.
- ``temperature`` [deg C, 10], ``salinity`` [35], ``ph`` [8]: for these formulas and absorption.
- ``absorption_formula`` [francois-garrison]: of `mitsonar.water.absorption_db`.
- ``absorption_db_per_km``: absorption given instead, the same at all frequencies; a number, or a table: depth [m] :
  dB/km, increasing depths, linear between, constant beyond.
- ``wind_speed`` [m/s, 5], ``shipping`` [0..1, 0.5]: ambient noise.
- ``volume_strength_db``: what the water sends back [dB re 1/m], a number or a table, depth [m] : strength; none by
  default.
- ``layers``: more of it between two depths, "name top bottom dB; ...", such as "fish 20 35 -55; kelp 5 12 -60". Of
  `mitsonar.water.volume.LAYERS` (fish, plankton, bubbles) numbers may be left out. The bubbles of the wind are part of
  `windy_sea`.

.. code-block:: xml

    <medium type="seawater">
        <string name="cast" value="casts/summer.csv"/>
        <float name="ph" value="8.1"/>
    </medium>
"""
import mitsuba as mi
import numpy as np

from mitsonar.io import casts
from mitsonar.plugins.attributes import Attributes
from mitsonar.water import SoundSpeedProfile, absorption, absorption_db, ambient_noise_db, seawater, sound_speed
from mitsonar.water.column import AbsorptionColumn
from mitsonar.water.profile import FASTEST, SLOWEST
from mitsonar.water.ranges import RANGES, SOUND_SPEED_RANGES
from mitsonar.water.volume import Layer, VolumeScattering

COLUMN = np.concatenate([np.arange(0, 100, 5.0), np.arange(100, 1000, 50.0), np.arange(1000, 6001, 250.0)])


class Seawater(mi.Medium):
    """See the module's text.

    Attributes
    ----------
    volume : VolumeScattering or None
    """

    def __init__(self, props):
        attributes = Attributes(props)
        self.temperature = attributes.number("temperature", 10.0, unit="deg C")
        self.salinity = attributes.number("salinity", 35.0)
        self.ph = attributes.number("ph", 8.0)
        self.wind_speed = attributes.number("wind_speed", 5.0, minimum=0, unit="m/s")
        self.shipping = attributes.number("shipping", 0.5, minimum=0, maximum=1)
        self.absorption_formula = attributes.text("absorption_formula", "francois-garrison",
                                                  choices=list(absorption.FORMULAS))
        self.given_absorption = self._read_absorption(attributes)
        self.volume = self._read_volume(attributes)
        self.cast = None
        self.profile = self._read_profile(attributes)
        attributes.finish()
        try:
            self.absorption_column(100e3)          # refuse water outside the formula's range now, not at the first ping
        except ValueError as error:
            raise attributes.error(str(error)) from None
        super().__init__(props)

    def _read_absorption(self, attributes):
        """The column that the scene writes, the same at all frequencies; None where a formula is to say."""
        table = _downwards(attributes, "absorption_db_per_km",
                           attributes.number_or_table("absorption_db_per_km", None, unit="dB/km"))
        _only_one(attributes, "absorption_formula", "absorption_db_per_km")
        if table is None:
            return None
        depth, per_km_db = table
        try:
            return AbsorptionColumn(depth, per_km_db / 1000)
        except ValueError as error:
            raise attributes.error(f"absorption_db_per_km: {error}; write numbers of 0 or more.") from None

    def _read_profile(self, attributes):
        _only_one(attributes, "profile", "cast", "sound_speed", "sound_speed_formula")
        table = _downwards(attributes, "profile", attributes.table("profile", None))
        path = attributes.file("cast", None)
        source = attributes.text("cast_sound_speed", "file", choices=list(casts.SOUND_SPEEDS))
        extension = attributes.text("cast_extension", "constant", choices=list(casts.EXTENSIONS))
        if path is None and attributes.given("cast_sound_speed", "cast_extension"):
            raise attributes.error(f"{attributes.given('cast_sound_speed', 'cast_extension')[0]} is given without a "
                                   "cast; give cast too.")
        constant = attributes.number("sound_speed", None, above=SLOWEST, below=FASTEST, unit="m/s")
        formula = attributes.text("sound_speed_formula", "teos-10", choices=list(seawater.FORMULAS))
        try:
            if table is not None:
                return SoundSpeedProfile(*table)
            if path is not None:
                self.cast = casts.read(path, sound_speed=source, extension=extension)
                return self.cast.profile
            if constant is not None:
                return SoundSpeedProfile([0.0], [constant])
            depth = COLUMN[COLUMN <= {**RANGES, **SOUND_SPEED_RANGES[formula]}["depth"][1]]
            return SoundSpeedProfile(depth, sound_speed(self.temperature, self.salinity, depth, formula=formula))
        except ValueError as error:
            raise attributes.error(str(error)) from None

    def _read_volume(self, attributes):
        table = _downwards(attributes, "volume_strength_db",
                           attributes.number_or_table("volume_strength_db", None, unit="dB re 1/m"))
        layers = attributes.text("layers", "")
        if table is None and not layers.strip():
            return None
        try:
            layers = [Layer.read(layer) for layer in layers.split(";") if layer.strip()]
            volume = VolumeScattering(*(table or ()), layers=layers)
        except ValueError as error:
            raise attributes.error(str(error)) from None
        for layer in layers:
            if layer.top < 0:
                raise attributes.error(f"layer {layer.name} begins at {layer.top:g} m; depths are positive down.")
        return volume

    def absorption_column(self, frequency):
        """Absorption against depth at one frequency [Hz], as an `AbsorptionColumn`."""
        if self.given_absorption is not None:
            return self.given_absorption
        if self.cast is not None and self.cast.temperature is not None and self.cast.salinity is not None:
            depth = self.profile.depth
            return AbsorptionColumn(depth, absorption_db(frequency, self.cast.temperature, self.cast.salinity,
                                                         np.maximum(depth, 0), self.ph, self.absorption_formula))
        return AbsorptionColumn(COLUMN, absorption_db(frequency, self.temperature, self.salinity, COLUMN, self.ph,
                                                      self.absorption_formula))

    def mean_absorption(self, top, bottom):
        """Absorption [dB/m] between two depths [m] as a function of frequencies [Hz]; None where it is one for all."""
        if self.given_absorption is not None:
            return None
        depth = np.linspace(top, max(bottom, top + 1), 33)

        def absorption_db(frequency):
            grid = np.linspace(frequency.min(), frequency.max(), 33)
            column = [float(np.mean(self.absorption_column(f).at(depth))) for f in np.maximum(grid, 1.0)]
            return np.interp(frequency, grid, column)

        return absorption_db

    def noise_level_db(self, frequency):
        """Ambient noise [dB re 1 µPa²/Hz] at a frequency [Hz]."""
        return float(ambient_noise_db(frequency, self.wind_speed, self.shipping))

    def traverse(self, callback):
        pass

    # A ray integrator of light would ask these; sound is traced by `sonar_path`, for which the water is clear.
    def intersect_aabb(self, ray):
        return mi.Mask(True), mi.Float(0), mi.Float(np.inf)

    def get_majorant(self, mei, active=True):
        return mi.Spectrum(0)

    def get_scattering_coefficients(self, mei, active=True):
        return mi.Spectrum(0), mi.Spectrum(0), mi.Spectrum(0)

    def to_string(self):
        speed = self.profile.sound_speed
        return f"Seawater[{len(speed)} nodes, {speed.min():.1f}..{speed.max():.1f} m/s]"


def _downwards(attributes, name, table):
    """A table against depth as it is; its author may have written z."""
    if table is not None and (table[0] < 0).any():
        raise attributes.error(f"{name} has the depth {table[0].min():g} m; depths are positive down.")
    return table


def _only_one(attributes, *names):
    written = attributes.given(*names)
    if len(written) > 1:
        raise attributes.error(f"{' and '.join(written)} are given; give one of them.")


mi.register_medium("seawater", Seawater)
