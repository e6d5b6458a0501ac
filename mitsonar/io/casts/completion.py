"""Completion and cleaning of casts.

    z = z(p, latitude)    S = S(C, T, p)    c = c(S, T, z)                                     TEOS-10, by gsw
    c(z) = c(z_K) + c(S_K, T_K, z) - c(S_K, T_K, z_K)    below the deepest sample K           extension "gradient"

Above its first sample and, with the extension "constant", below its last sample a profile is constant. "gradient" is
water that is mixed down to the seabed: the temperature and salinity of the deepest sample (`MIXED` for a cast without
them: over all seas the gradient differs by 3 %), at rising pressure, about 0.0164 1/s.

Cleaning turns the samples of an instrument into nodes of a profile. An instrument logs in time: in air, at rest under
the surface until its sensors have settled (the soak), down, and up through water that it has stirred. These samples are
kept:

- samples in water. Samples in air are those with a sound speed below `SLOWEST_WATER`, and those within `SPLASH` of the
  surface whose conductivity is below half the median of the cast (a cell half full of water);
- of these, samples whose depth does not differ from the median of the five around it by more than `SPIKE` and ten times
  the step that three quarters of the samples stay below: a wrong pressure must not be the deepest sample;
- of these, samples before the deepest one and, if the instrument came up again by more than `RISE` to less than `SOAK`
  before its final descent, only those after that turn;
- of these, samples at least as deep as every sample before, so that heave does not fold the profile;
- of these, one sample for each depth: samples less than `SAME_DEPTH` deeper than the first of a group are averaged.

Processed casts are sorted, and samples at one depth averaged. A plain table is used as written: a depth that does not
increase is an error.
"""
import gsw
import numpy as np

from mitsonar.water.profile import FASTEST, SLOWEST, SoundSpeedProfile
from mitsonar.water.seawater import sound_speed

from .records import Cast, Cleaning, Samples

SLOWEST_WATER = 1350.0  # [m/s]: fresh water at 0 deg C has 1402, and instruments write 0 in air
SPLASH = 0.5            # [m]
RISE, SOAK = 0.1, 2.0   # [m]
SAME_DEPTH = 0.05       # [m]
SPIKE = 1.0             # [m]


def cleaned(samples: Samples) -> tuple[Samples, Cleaning]:
    """Return the cleaned samples, which have a depth, by their state."""
    counts = {"read": samples.lines.size + samples.flagged, "flagged": samples.flagged}
    if samples.state == "ordered":
        _check_order(samples)
        return samples, Cleaning(**counts)
    if samples.state == "processed":
        samples, counts["merged"] = _merged(samples.taking(np.argsort(samples.columns["depth"], kind="stable")), 0.0)
        return samples, Cleaning(**counts)
    for name, step in (("in_air", _in_water), ("spikes", _without_spikes), ("upcast", _to_the_deepest),
                       ("soak", _after_the_soak), ("reversals", _deepening)):
        before, samples = samples.lines.size, samples.taking(step(samples))
        counts[name] = before - samples.lines.size
    samples, counts["merged"] = _merged(samples, SAME_DEPTH)
    return samples, Cleaning(**counts)


def _check_order(samples):
    depth = samples.columns["depth"]
    bad = np.flatnonzero(np.diff(depth) <= 0)
    if bad.size:
        k = bad[0] + 1
        raise ValueError(f"line {samples.lines[k]}: depth {depth[k]:g} m follows {depth[k - 1]:g} m; depths are "
                         "positive down and must increase from row to row: sort the rows and merge repeated depths.")


def _in_water(samples):
    columns = samples.columns
    below = columns["depth"] > SPLASH
    wet = columns.get("sound speed", np.full(below.shape, np.inf)) >= SLOWEST_WATER
    conductivity = columns.get("conductivity")
    if conductivity is not None and below.any():
        wet &= (conductivity > 0) & (below | (conductivity >= 0.5 * np.median(conductivity[below])))
    if not (wet & below).any():
        raise ValueError(f"all {wet.size} samples were taken in air or within {SPLASH:g} m of the surface; give a cast "
                         "that went into the water.")
    return wet


def _smoothed(depth):
    from scipy.ndimage import median_filter

    return median_filter(depth, 5, mode="nearest")


def _without_spikes(samples):
    depth = samples.columns["depth"]
    step = np.percentile(np.abs(np.diff(depth)), 75) if depth.size > 1 else 0.0
    return np.abs(depth - _smoothed(depth)) <= SPIKE + 10 * step


def _to_the_deepest(samples):
    depth = samples.columns["depth"]
    deepest = int(np.argmax(depth))
    top, span = depth[:deepest + 1].min(), np.ptp(depth)
    if top - depth.min() > max(0.5 * span, SPLASH):
        raise ValueError(f"it holds no way down: before its deepest sample (line {samples.lines[deepest]}) it has "
                         f"{top:g}..{depth[deepest]:g} m of {depth.min():g}..{depth[deepest]:g} m; give a recording "
                         "from the surface down, or a plain table sorted by depth.")
    return np.arange(depth.size) <= deepest


def _after_the_soak(samples):
    depth = samples.columns["depth"]
    steady = _smoothed(depth)                                   # a single shallow sample is no turn
    risen = np.flatnonzero((steady < SOAK) & (np.maximum.accumulate(steady) - steady > RISE))
    start = 0
    if risen.size:
        soak = int(np.argmax(steady[:risen[-1] + 1]))
        start = soak + int(np.argmin(depth[soak:risen[-1] + 1]))
    return np.arange(depth.size) >= start


def _deepening(samples):
    depth = samples.columns["depth"]
    return depth >= np.maximum.accumulate(depth)


def _merged(samples, width):
    """Return the averages of the samples of each depth, which are sorted, and the number of merged samples."""
    depth, starts = samples.columns["depth"], [0]
    for k, value in enumerate(depth.tolist()):
        if value - depth[starts[-1]] > width:
            starts.append(k)
    count = np.diff([*starts, depth.size])
    means = {what: np.add.reduceat(values, starts) / count for what, values in samples.columns.items()}
    return samples.taking(starts, **means), int(depth.size - count.size)


UNKNOWN_LATITUDE, UNKNOWN_LONGITUDE = 45.0, -20.0   # from there to pole or equator, gravity changes depths by 0.26 %
HIGHEST, DEEPEST = -20.0, 12000.0                   # [m]
MIXED = {"temperature": 10.0, "salinity": 35.0}
SOUND_SPEEDS = ("file", "teos-10")
EXTENSIONS = ("constant", "gradient")
STEPS = np.concatenate([np.arange(0, 1000, 50.0), np.arange(1000, DEEPEST + 1, 250.0)])


def completed(samples: Samples, name: str, source: str, extension: str) -> Cast:
    """Return the cast of samples: cleaned, completed and extended."""
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
    """Compute depths from pressures if there are no depths; check depths and sound speeds line by line."""
    latitude = None
    if "depth" not in samples.columns:
        latitude = UNKNOWN_LATITUDE if samples.latitude is None else samples.latitude
        _check(samples, "pressure", "dbar", -20, 1.05 * DEEPEST)
        samples = samples.taking(slice(None), depth=-gsw.z_from_p(samples.columns["pressure"], latitude))
    _check(samples, "depth", "m", HIGHEST, DEEPEST)
    if "sound speed" in samples.columns:
        # In air an instrument may write any low value, which the cleaning drops.
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
    with np.errstate(all="ignore"):                 # NaN for impossible water is refused below
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
    """Return the columns with further nodes at the depths of `STEPS` below the deepest sample."""
    columns = samples.columns
    below = STEPS[STEPS > columns["depth"][-1]]
    last = {what: float(columns[what][-1]) if what in columns else MIXED[what] for what in MIXED}
    speed = _teos_10(samples, **last, depth=np.r_[columns["depth"][-1], below])
    more = {**last, "depth": below, "sound speed": columns["sound speed"][-1] + speed[1:] - speed[0]}
    return {what: np.r_[values, np.broadcast_to(more[what], below.shape)] for what, values in columns.items()
            if what in more}
