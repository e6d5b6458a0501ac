"""Seawater (`seawater`): sound speed against depth, absorption, ambient noise, volume scattering.

Sound speed comes from ``profile``, ``cast``, ``casts`` or ``sound_speed``; without any of them, a formula computes it
from ``temperature`` and ``salinity``.

A profile is linear between its depths and constant beyond them. A cast is a file that `mitsonar.io.casts` reads; its
temperature and salinity, if present, set the absorption. A formula is used down to 6000 m or to its limit of validity;
below, the sound speed is constant.

Water that changes along the line has several ``casts``: a folder of files, a file that holds several, a recorded line
(.all, .kmall, .gsf), or a list: a CSV file with the column ``file``, and ``time``, ``x`` and ``y`` [m] in the scene, or
``latitude`` and ``longitude`` [degrees]. Each ping has the water of the nearest cast, or water mixed from two. Slant
ranges are converted to times with the first cast, unless the sonar has a ``sound_speed``.

`mi.traverse` lists the sound speeds at the profile's nodes (``sound_speed``), ``absorption_offset`` [dB/m] and
``absorption_scale``. The offset is added to the absorption at the profile's nodes and is linear between them; it is 0
at first and the same at all frequencies, for fits of layers that no formula describes. The scale multiplies the sum.

Sonars that steer beams measure the sound speed at their head. Write it as ``head_sound_speed``: it becomes the
profile's node at ``head_depth``, in place of any node within 5 mm; the water is linear from there to the nodes above
and below.

.. code-block:: xml

    <medium type="seawater">
        <string name="cast" value="casts/summer.csv"/>
        <float name="ph" value="8.1"/>
    </medium>
"""
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload
from mitsonar.io import casts
from mitsonar.io.casts.series import PlacedCast, read_series
from mitsonar.io.grids.separation import FARTHEST, Separation
from mitsonar.io.tracks import tides
from mitsonar.io.tracks.tides import Tide
from mitsonar.water import absorption, along_line, seawater
from mitsonar.water.absorption import absorption_db
from mitsonar.water.column import AbsorptionColumn
from mitsonar.water.fields import FIELDS, UnplacedField
from mitsonar.water.garrett_munk import GarrettMunk
from mitsonar.water.noise import ambient_noise_db
from mitsonar.water.profile import FASTEST, SLOWEST, SoundSpeedProfile
from mitsonar.water.ranges import RANGES, SOUND_SPEED_RANGES
from mitsonar.water.seawater import sound_speed
from mitsonar.water.volume import Layer, VolumeScattering

from ..attributes import Angle, Attributes, Choice, File, FileOrFolder, Integer, Number, NumberOrTable, Table, Text

COLUMN = np.concatenate([np.arange(0, 100, 5.0), np.arange(100, 1000, 50.0), np.arange(1000, 6001, 250.0)])

ACROSS, DEEP_WAVES = ("field", tuple(FIELDS)), ("field", ("garrett_munk",))
ATTRIBUTES = (
    Table("profile", default=None, unit="m : m/s",
          text="depth : sound speed, increasing depths; or write `cast` or `sound_speed`"),
    File("cast", default=None, text="file of a cast"),
    FileOrFolder("casts", default=None,
                 text="several casts with times or places: a folder, a file that holds several, a recorded line, or a "
                      "CSV list of files"),
    Choice("casts_by", default=None, choices=tuple(along_line.BY),
           otherwise="place, or time if a cast has no place", text="how pings find their casts"),
    Choice("casts_rule", default="nearest", choices=tuple(along_line.RULES),
           text="water of a ping: that of the nearest cast; that of the last one before, in time; or interpolated, in "
                "time or along the track"),
    Number("casts_step", default=0.5, minimum=0, unit="m/s",
           text="interpolated water changes in steps of at most this sound speed, because every new water takes time "
                "to prepare; 0: at every ping"),
    File("tide", default=None,
         text="table of the water level: a CSV file of `time` (UTC, or seconds after the first ping) and `height` [m] "
              "above z = 0, CARIS or CO-OPS; the water and sonars of a given depth ride on it; the bed and objects "
              "stay"),
    Number("separation", default=None, minimum=-FARTHEST, maximum=FARTHEST, unit="m",
           text="height of z = 0, the vertical datum, above the ellipsoid WGS 84: soundings then have heights by "
                "satellites, `ping_height`; added to the grid of `separation_file` if both are given"),
    File("separation_file", default=None,
         text="grid of the separation, such as a geoid: GTX, GeoTIFF and other rasters"),
    Text("vertical_datum", default="", text="name of the vertical datum z = 0, which soundings state"),
    Choice("field", default="none", choices=("none", *FIELDS, "garrett_munk", "grid"),
           text="sound speed that changes across, beside the profile: a front, an even gradient, a solitary "
                "internal wave on the profile's thermocline, the internal waves of the deep sea, or the grid of a "
                "netCDF file"),
    Angle("field_latitude_deg", default=45.0, minimum=-90, maximum=90, only=DEEP_WAVES,
          text="latitude, which sets the lowest frequency of the internal waves"),
    Number("field_level", default=1.0, above=0, maximum=100, only=DEEP_WAVES,
           text="energy of the internal waves, over that of the model"),
    Integer("field_seed", default=0, minimum=0, only=DEEP_WAVES, text="seed of the internal waves"),
    File("field_file", default=None, only=("field", ("grid",)),
         text="netCDF-4 file with a grid of sound speed, or of temperature and salinity, by CF standard names; its "
              "mean profile is that of the water unless another one is given"),
    Number("field_x", default=0.0, unit="m", only=ACROSS,
           text="a place of the front or the crest, or where the gradient's change is 0, at the first ping"),
    Number("field_y", default=0.0, unit="m", only=ACROSS, text="the same, north"),
    Angle("field_heading_deg", default=90.0, only=ACROSS,
          text="direction along which the sound speed changes, clockwise from north"),
    Number("field_speed", default=0.0, unit="m/s", only=ACROSS, text="speed of the field along its heading"),
    Number("field_change", default=2.0, unit="m/s", only=("field", ("front",)),
           text="sound speed ahead of the front minus that behind it"),
    Number("field_width", default=60.0, above=0, unit="m", only=("field", ("front",)), text="width of the front"),
    Number("field_gradient", default=0.01, unit="1/s", only=("field", ("gradient",)), text="m/s per metre"),
    Number("field_height", default=2.0, unit="m", only=("field", ("internal_wave",)),
           text="height of the internal wave, positive down"),
    Number("field_length", default=30.0, above=0, unit="m", only=("field", ("internal_wave",)),
           text="length of the internal wave: it is down to 0.42 of its height at this distance from the crest"),
    Number("field_bending_ns", default=100.0, above=0, unit="ns", only=("field", (*FIELDS, "garrett_munk", "grid")),
           text="a warning is given if a field bends rays so much that they arrive earlier by more than this; times "
                "are then off by up to half of it"),
    Number("sound_speed", default=None, above=SLOWEST, below=FASTEST, unit="m/s",
           text="sound speed at all depths; without any of these three, it is computed from temperature and salinity"),
    Choice("cast_sound_speed", default="file", choices=tuple(casts.SOUND_SPEEDS),
           text="source of the sound speed of casts: the file's own column, or a formula of its temperature and "
                "salinity"),
    Choice("cast_extension", default="constant", choices=tuple(casts.EXTENSIONS),
           text="sound speed below casts: its last value, or the gradient of mixed water under rising pressure, "
                "about 0.0164 1/s"),
    Choice("sound_speed_formula", default="teos-10", choices=tuple(seawater.FORMULAS),
           text="formula that computes sound speed; `medwin` is valid to 1000 m"),
    Number("head_sound_speed", default=None, above=SLOWEST, below=FASTEST, unit="m/s",
           text="sound speed measured at the sonar's head: replaces the node of the profile at that depth"),
    Number("head_depth", default=None, minimum=0, unit="m", text="depth of the sensor of `head_sound_speed`"),
    Number("temperature", default=10.0, unit="deg C", text="temperature, for sound speed and absorption"),
    Number("salinity", default=35.0, text="practical salinity, for sound speed and absorption"),
    Number("ph", default=8.0, text="pH, for absorption"),
    Choice("absorption_formula", default="francois-garrison", choices=tuple(absorption.FORMULAS),
           text="formula of absorption; `thorp` depends on frequency only, for comparison with older results"),
    NumberOrTable("absorption_db_per_km", default=None, otherwise="computed", unit="dB/km",
                  text="absorption at all frequencies, in place of the formula; a table has depth [m] : dB/km, "
                       "linear between"),
    Number("wind_speed", default=5.0, minimum=0, unit="m/s", text="wind speed, for ambient noise"),
    Number("shipping", default=0.5, minimum=0, maximum=1,
           text="shipping density, for ambient noise: 0 remote, 1 heavy"),
    NumberOrTable("volume_strength_db", default=None, unit="dB re 1/m",
                  text="volume scattering strength; a table has depth [m] : strength"),
    Text("layers", default="",
         text='additional scattering layers, "name top bottom dB; ...", such as "fish 20 35 -55; kelp 5 12 -60"; '
              '`fish`, `plankton` and `bubbles` have defaults for numbers left out; the bubbles of the wind are part '
              'of `windy_sea`'),
)


class Seawater(mi.Medium):
    """Water of a scene."""
    # speeds (K,) [m/s]; absorption_offset (K,) [dB/m]; absorption_scale (1,) [-]

    def __init__(self, props: mi.Properties) -> None:
        attributes = Attributes(props, ATTRIBUTES)
        self.temperature, self.salinity, self.ph = attributes.temperature, attributes.salinity, attributes.ph
        self.wind_speed, self.shipping = attributes.wind_speed, attributes.shipping
        self.absorption_formula = attributes.absorption_formula
        for name in ("absorption_db_per_km", "profile", "volume_strength_db"):
            _check_depths(attributes, name)
        self.given_absorption = _given_absorption(attributes)
        self.volume = _volume(attributes)
        self.casts = _casts(attributes)
        self.casts_by, self.casts_rule = attributes.casts_by, attributes.casts_rule
        self.casts_step = attributes.casts_step
        self.field, self.tide = _field(attributes), _tide(attributes)
        self.separation, self.vertical_datum = _separation(attributes), attributes.vertical_datum
        self.cast, water = _cast_and_profile(attributes, self.casts)
        mean = getattr(self.field, "profile", None)            # of a grid
        if mean is not None and not attributes.given("profile", "cast", "casts", "sound_speed", "sound_speed_formula",
                                                     "temperature", "salinity"):
            water = mean
        self.field_bending = 1e-9 * float(attributes.field_bending_ns or 0.0)
        self.profile = self.loaded_profile = water if self.casts else _with_head(attributes, water)
        self.speeds = upload(mi.Float64, self.profile.sound_speed)
        self.absorption_scale = upload(mi.Float64, np.ones(1))
        self.absorption_offset = upload(mi.Float64, np.zeros(len(self.profile.depth)))
        try:
            # refuse water outside the formula's range now, not at the first ping
            for cast in [one.cast for one in self.casts] or [self.cast]:
                self.absorption_column(100e3, cast)
        except ValueError as error:
            raise attributes.error(error) from None
        super().__init__(props)

    def absorption_column(self, frequency: float, cast: casts.Cast | None = None) -> AbsorptionColumn:
        """Return the absorption against depth at one frequency [Hz], in the water of one of several casts."""
        column, scale = self._column(frequency, cast or self.cast), float(dr.detach(self.absorption_scale).numpy()[0])
        offset = dr.detach(self.absorption_offset).numpy()
        if np.any(offset):
            column = column.added(self.profile.depth, offset)
        return column if scale == 1 else AbsorptionColumn(column.depth, scale * column.absorption_db)

    def _column(self, frequency, cast):
        if self.given_absorption is not None:
            return self.given_absorption
        if cast is not None and cast.temperature is not None and cast.salinity is not None:
            depth = cast.profile.depth
            return AbsorptionColumn(depth, absorption_db(frequency, cast.temperature, cast.salinity,
                                                         np.maximum(depth, 0), self.ph, self.absorption_formula))
        return AbsorptionColumn(COLUMN, absorption_db(frequency, self.temperature, self.salinity, COLUMN, self.ph,
                                                      self.absorption_formula))

    def mean_absorption(self, top: float, bottom: float,
                        cast: casts.Cast | None = None) -> Callable[[np.ndarray], np.ndarray] | None:
        """Absorption [dB/m] between two depths [m] as a function of frequencies [Hz]; None where it is one for all."""
        if self.given_absorption is not None:
            return None
        depth = np.linspace(top, max(bottom, top + 1), 33)

        def absorption_db(frequency: np.ndarray) -> np.ndarray:
            grid = np.linspace(frequency.min(), frequency.max(), 33)
            column = [float(np.mean(self.absorption_column(f, cast).at(depth))) for f in np.maximum(grid, 1.0)]
            return np.interp(frequency, grid, column)

        return absorption_db

    def noise_level_db(self, frequency: float) -> float:
        """Return the ambient noise [dB re 1 µPa²/Hz] at a frequency [Hz]."""
        return float(ambient_noise_db(frequency, self.wind_speed, self.shipping))

    def traverse(self, callback: mi.TraversalCallback) -> None:
        if not self.casts:             # several casts have no common nodes
            callback.put("sound_speed", self.speeds, mi.ParamFlags.Differentiable)
        callback.put("absorption_scale", self.absorption_scale, mi.ParamFlags.Differentiable)
        if not self.casts:
            callback.put("absorption_offset", self.absorption_offset, mi.ParamFlags.Differentiable)

    def parameters_changed(self, keys: list[str]) -> None:
        speeds, scale = (dr.detach(value).numpy() for value in (self.speeds, self.absorption_scale))
        nodes = len(self.profile.depth)
        if len(speeds) != nodes:
            raise ValueError(f"seawater: sound_speed has {len(speeds)} numbers, and the profile {nodes} nodes; give "
                             "one for each.")
        if not np.array_equal(speeds, self.profile.sound_speed):
            self.profile = SoundSpeedProfile(self.profile.depth, speeds)
        if len(scale) != 1 or not np.isfinite(scale[0]) or scale[0] < 0:
            raise ValueError(f"seawater: absorption_scale is {scale.tolist()}; give one number of 0 or more.")
        offset = dr.detach(self.absorption_offset).numpy()
        if len(offset) != nodes or not np.all(np.isfinite(offset)):
            raise ValueError(f"seawater: absorption_offset has {len(offset)} numbers, and the profile {nodes} nodes; "
                             "give a finite one for each.")

    # A ray integrator of light would ask these; sound is traced by `sonar_path`, for which the water is clear.
    def intersect_aabb(self, ray: mi.Ray3f) -> tuple[mi.Bool, mi.Float, mi.Float]:
        return mi.Bool(True), mi.Float(0), mi.Float(np.inf)

    def get_majorant(self, mei: mi.MediumInteraction3f, active: mi.Bool | bool = True) -> mi.Spectrum:
        return mi.Spectrum(0)

    def get_scattering_coefficients(self, mei: mi.MediumInteraction3f, active: mi.Bool | bool = True
                                    ) -> tuple[mi.Spectrum, mi.Spectrum, mi.Spectrum]:
        return mi.Spectrum(0), mi.Spectrum(0), mi.Spectrum(0)

    def to_string(self) -> str:
        speed = self.profile.sound_speed
        return f"Seawater[{len(speed)} nodes, {speed.min():.1f}..{speed.max():.1f} m/s]"


def _check_depths(attributes, name):
    """Refuse a table whose author wrote z for depth."""
    table = getattr(attributes, name)
    if table is not None and (table[0] < 0).any():
        raise attributes.error(f"{name} has the depth {table[0].min():g} m; depths are positive down.")


def _given_absorption(attributes):
    """Return the absorption written in the scene, the same at all frequencies; None if a formula computes it."""
    attributes.only_one("absorption_formula", "absorption_db_per_km")
    if attributes.absorption_db_per_km is None:
        return None
    depth, per_km_db = attributes.absorption_db_per_km
    try:
        return AbsorptionColumn(depth, per_km_db / 1000)
    except ValueError as error:
        raise attributes.error(f"absorption_db_per_km: {error}; write numbers of 0 or more.") from None


def _casts(attributes: Attributes) -> tuple[PlacedCast, ...]:
    """Return the casts of water that changes along the line; none without `casts`."""
    if attributes.casts is None:
        if details := attributes.given("casts_by", "casts_rule", "casts_step"):
            raise attributes.error(f"{details[0]} is given without casts; give casts too.")
        return ()
    if attributes.casts_rule != "interpolated" and attributes.given("casts_step"):
        raise attributes.error('casts_step is given, but it only counts with casts_rule "interpolated"; leave it out.')
    try:
        series = read_series(attributes.casts, partial(casts.read, sound_speed=attributes.cast_sound_speed,
                                                       extension=attributes.cast_extension))
        return tuple(replace(one, cast=_headed(attributes, one.cast)) for one in series)
    except ValueError as error:
        raise attributes.error(error) from None


def _field(attributes: Attributes) -> UnplacedField | None:
    """Return the sound speed that changes across, or None."""
    if attributes.field == "none":
        return None
    if attributes.field == "grid":
        if attributes.field_file is None:
            raise attributes.error("field is a grid, but field_file is missing; name the netCDF file.")
        from mitsonar.io.grids import speed_grid  # xarray takes its time, and few scenes need it

        try:
            return speed_grid.read(attributes.field_file)
        except ValueError as error:
            raise attributes.error(error) from None
    if attributes.field == "garrett_munk":
        return GarrettMunk.of(latitude=attributes.field_latitude_deg, level=attributes.field_level,
                              seed=attributes.field_seed)
    heading = attributes.field_heading_deg
    own = {"front": {"change_of_speed": attributes.field_change, "width": attributes.field_width},
           "gradient": {"gradient": attributes.field_gradient},
           "internal_wave": {"height": attributes.field_height, "length": attributes.field_length}}
    return FIELDS[attributes.field](x=attributes.field_x, y=attributes.field_y, sine=float(np.sin(heading)),
                                    cosine=float(np.cos(heading)), speed=attributes.field_speed,
                                    **own[attributes.field])


def _tide(attributes: Attributes) -> Tide | None:
    """Return the height of the water level, or None."""
    try:
        return None if attributes.tide is None else tides.load(attributes.tide)
    except ValueError as error:
        raise attributes.error(error) from None


def _separation(attributes: Attributes) -> Separation | None:
    """Return the height of the datum above the ellipsoid, or None."""
    if attributes.separation is None and attributes.separation_file is None:
        return None
    try:
        return Separation(constant=attributes.separation or 0.0, path=attributes.separation_file)
    except ValueError as error:
        raise attributes.error(error) from None


def _headed(attributes: Attributes, cast: casts.Cast) -> casts.Cast:
    """Return one of several casts with the node of the head's own sensor, if there is one."""
    profile = _with_head(attributes, cast.profile)
    temperature, salinity = (None if column is None else np.interp(profile.depth, cast.profile.depth, column)
                             for column in (cast.temperature, cast.salinity))
    return cast if profile is cast.profile else replace(cast, profile=profile, temperature=temperature,
                                                        salinity=salinity)


def _cast_and_profile(attributes: Attributes,
                      several: Sequence[PlacedCast]) -> tuple[casts.Cast | None, SoundSpeedProfile]:
    """Return the cast, the first of several, or None; and the sound speed profile."""
    attributes.only_one("profile", "cast", "casts", "sound_speed", "sound_speed_formula")
    details = attributes.given("cast_sound_speed", "cast_extension")
    if attributes.cast is None and not several and details:
        raise attributes.error(f"{details[0]} is given without a cast; give cast too.")
    if several:
        return several[0].cast, several[0].cast.profile
    try:
        if attributes.profile is not None:
            return None, SoundSpeedProfile(*attributes.profile)
        if attributes.cast is not None:
            cast = casts.read(attributes.cast, sound_speed=attributes.cast_sound_speed,
                              extension=attributes.cast_extension)
            return cast, cast.profile
        if attributes.sound_speed is not None:
            return None, SoundSpeedProfile(np.zeros(1), np.array([attributes.sound_speed]))
        formula = attributes.sound_speed_formula
        depth = COLUMN[COLUMN <= {**RANGES, **SOUND_SPEED_RANGES[formula]}["depth"][1]]
        speed = sound_speed(attributes.temperature, attributes.salinity, depth, formula=formula)
        return None, SoundSpeedProfile(depth, speed)
    except ValueError as error:
        raise attributes.error(error) from None


def _with_head(attributes: Attributes, profile: SoundSpeedProfile) -> SoundSpeedProfile:
    """Return the profile with the node of the head's own sensor, if there is one."""
    given = attributes.given("head_sound_speed", "head_depth")
    if len(given) == 1:
        other = "head_depth" if given[0] == "head_sound_speed" else "head_sound_speed"
        raise attributes.error(f"{given[0]} is given without {other}; give both.")
    if not given:
        return profile
    if attributes.sound_speed is not None:
        raise attributes.error("head_sound_speed is given, but sound_speed is the same at all depths; give a profile "
                               "or a cast, or leave the head's out.")
    try:
        return profile.with_node(attributes.head_depth, attributes.head_sound_speed)
    except ValueError as error:
        raise attributes.error(f"head_depth: {error}") from None


def _volume(attributes: Attributes) -> VolumeScattering | None:
    """Return the volume scattering of the water; None for none."""
    table = attributes.volume_strength_db
    if table is None and not attributes.layers.strip():
        return None
    try:
        layers = [Layer.read(layer) for layer in attributes.layers.split(";") if layer.strip()]
        volume = VolumeScattering(*(table or ()), layers=layers)
    except ValueError as error:
        raise attributes.error(error) from None
    for layer in layers:
        if layer.top < 0:
            raise attributes.error(f"layer {layer.name} begins at {layer.top:g} m; depths are positive down.")
    return volume


mi.register_medium("seawater", Seawater)
