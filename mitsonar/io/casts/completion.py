"""What a cast does not say itself: depth from pressure, salinity from conductivity, sound speed from both, and on down.

    z = z(p, latitude)    S = S(C, T, p)    c = c(S, T, z)                                     TEOS-10, by gsw
    c(z) = c(z_K) + c(S_K, T_K, z) - c(S_K, T_K, z_K)    below the deepest sample K           extension "gradient"

Above its first sample and below its last a profile is constant; the extension "constant" leaves it so. "gradient" is
water that is mixed down to the seabed: the temperature and salinity of the deepest sample (`MIXED` where it has none:
over all seas the gradient differs by 3 %), at rising pressure, about 0.0164 1/s.
"""
import gsw
import numpy as np

from mitsonar.water import SoundSpeedProfile, sound_speed
from mitsonar.water.profile import FASTEST, SLOWEST

from .cleaning import cleaned
from .records import Cast, Samples

UNKNOWN_LATITUDE, UNKNOWN_LONGITUDE = 45.0, -20.0   # gravity changes depths by 0.26 % from there to pole or equator
HIGHEST, DEEPEST = -20.0, 12000.0                   # [m]
MIXED = {"temperature": 10.0, "salinity": 35.0}
SOUND_SPEEDS = ("file", "teos-10")
EXTENSIONS = ("constant", "gradient")
STEPS = np.concatenate([np.arange(0, 1000, 50.0), np.arange(1000, DEEPEST + 1, 250.0)])


def completed(samples: Samples, name: str, source: str, extension: str) -> Cast:
    """Make the cast of samples.

    Parameters
    ----------
    samples : Samples
    name : str
        Of the format.
    source : str
        Of `SOUND_SPEEDS`.
    extension : str
        Of `EXTENSIONS`.

    Returns
    -------
    Cast

    Raises
    ------
    ValueError
        If a value is out of range, or what the sound speed is to be computed from is missing.
    """
    samples, latitude = _with_depth(samples)
    samples, cleaning = cleaned(samples)
    samples = _with_salinity(samples, latitude)
    samples, source = _with_sound_speed(samples, source)
    columns, measured = samples.columns, samples.lines.size
    if extension == "gradient":
        columns = _extended(samples)
    return Cast(profile=SoundSpeedProfile(columns["depth"], columns["sound speed"]), format=name,
                temperature=columns.get("temperature"), salinity=columns.get("salinity"), latitude=samples.latitude,
                longitude=samples.longitude, time=samples.time, sections=samples.sections, sound_speed_source=source,
                pressure_latitude=latitude, extension=extension, measured=measured, cleaning=cleaning)


def _with_depth(samples):
    """Turn pressure into depth where there is no depth, and check both depths and sound speeds, by line."""
    latitude = None
    if "depth" not in samples.columns:
        latitude = UNKNOWN_LATITUDE if samples.latitude is None else samples.latitude
        _check(samples, "pressure", "dbar", -20, 1.05 * DEEPEST)
        samples = samples.taking(slice(None), depth=-gsw.z_from_p(samples.columns["pressure"], latitude))
    _check(samples, "depth", "m", HIGHEST, DEEPEST)
    if "sound speed" in samples.columns:
        # In air an instrument writes anything below; the cleaning drops that.
        _check(samples, "sound speed", "m/s", -np.inf if samples.state == "recorded" else SLOWEST, FASTEST)
    return samples, latitude


def _check(samples, what, unit, low, high):
    values = samples.columns[what]
    inside = (values > low) & (values < high) if what == "sound speed" else (values >= low) & (values <= high)
    bad = np.flatnonzero(~inside)
    if bad.size:
        k = bad[0]
        limits = f"{SLOWEST if what == 'sound speed' else low:g}..{high:g}"
        raise ValueError(f"line {samples.lines[k]}: {what} {values[k]:g} {unit} is outside {limits} {unit}; "
                         "check columns and units.")


def _with_salinity(samples, latitude):
    columns = samples.columns
    if "salinity" in columns or not {"temperature", "conductivity"} <= set(columns):
        return samples
    pressure = columns.get("pressure")
    if pressure is None:
        latitude = UNKNOWN_LATITUDE if samples.latitude is None else samples.latitude
        pressure = gsw.p_from_z(-columns["depth"], latitude)
    with np.errstate(all="ignore"):                 # of impossible water; the next lines say so
        salinity = gsw.SP_from_C(columns["conductivity"], columns["temperature"], pressure)
    bad = np.flatnonzero(~np.isfinite(salinity))
    if bad.size:
        k = bad[0]
        raise ValueError(f"line {samples.lines[k]}: conductivity {columns['conductivity'][k]:g} mS/cm at "
                         f"{columns['temperature'][k]:g} deg C is that of no seawater; check columns and units.")
    return samples.taking(slice(None), salinity=salinity)


def _with_sound_speed(samples, source):
    columns = samples.columns
    if source == "file" and "sound speed" in columns:
        return samples, "file"
    missing = [what for what in ("temperature", "salinity") if what not in columns]
    if missing:
        raise ValueError(f"its sound speed cannot be computed by TEOS-10, for it has no {' and no '.join(missing)}; "
                         "take the sound speed of the file, or give a cast of a CTD.")
    return samples.taking(slice(None), **{"sound speed": _teos_10(samples, **{
        what: columns[what] for what in ("temperature", "salinity", "depth")})}), "teos-10"


def _teos_10(samples, **water):
    latitude = UNKNOWN_LATITUDE if samples.latitude is None else samples.latitude
    longitude = UNKNOWN_LONGITUDE if samples.longitude is None else samples.longitude
    return sound_speed(**water, latitude=latitude, longitude=longitude)


def _extended(samples):
    """Give the columns with nodes below the deepest sample, at the depths of `STEPS`."""
    columns = samples.columns
    below = STEPS[STEPS > columns["depth"][-1]]
    last = {what: float(columns[what][-1]) if what in columns else MIXED[what] for what in MIXED}
    speed = _teos_10(samples, **last, depth=np.r_[columns["depth"][-1], below])
    more = {**last, "depth": below, "sound speed": columns["sound speed"][-1] + speed[1:] - speed[0]}
    return {what: np.r_[values, np.broadcast_to(more[what], below.shape)] for what, values in columns.items()
            if what in more}
