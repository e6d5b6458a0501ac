"""Read one channel of a raw file of an EK80 (or ES80, EA440, EK60 transceivers under the EK80's program).

Samples of power come with angles. Signals of sectors are kept as they are [V]; power and angles follow from them by
`split_beams`, for chirps (FM) after their compression by `chirps`. Levels are received power, not strengths: gains and
beams of the file are attributes.
"""
from __future__ import annotations

import os
import warnings
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath, check_readable

from ..nmea import at_times, fix_of
from ..records.records import SonarImage
from . import datagrams, split_beams
from .chirps import Filter, compressed, replica
from .datagrams import Datagram

MOST_BYTES = 4_000_000_000         # of the samples in memory
MOST_FILTER = 300_000              # bytes, of 32767 coefficients
MOST_LINES = 5_000_000             # datagrams of pings and sensors
_KNOWN = ("XML0", "RAW3", "FIL1", "NME0", "MRU0")
_NUMBERS = {                       # attributes from the transducer's XML: name, unit that it has there
    "EquivalentBeamAngle": "equivalent_beam_angle_db", "BeamType": "beam_type",
    "AngleSensitivityAlongship": "angle_sensitivity_along", "AngleSensitivityAthwartship": "angle_sensitivity_athwart"}
_ANGLES = {"AngleOffsetAlongship": "angle_offset_along", "AngleOffsetAthwartship": "angle_offset_athwart",
           "BeamWidthAlongship": "beam_width_along", "BeamWidthAthwartship": "beam_width_athwart"}
FM = 1                             # PulseForm


@dataclass(kw_only=True)
class _SounderFile:
    """Collect the content of a file as its datagrams are walked."""

    pings: list[tuple[Datagram, str, Mapping[str, float]]] = field(default_factory=list)
    channels: dict[str, dict[str, object]] = field(default_factory=dict)
    filters: dict[str, dict[int, Filter]] = field(default_factory=dict)
    sentences: list[Datagram] = field(default_factory=list)
    motion: list[Datagram] = field(default_factory=list)
    environment: Mapping[str, float] = field(default_factory=dict)
    others: Counter[str] = field(default_factory=Counter)


def recognised(head: bytes) -> bool:
    """Return True for the first eight bytes of a raw file, which begins with its configuration."""
    return head[4:8] == b"XML0"


def read(path: FilePath, *, channel: str | None = None, frequency: float | None = None,
         pings: slice | None = None) -> SonarImage:
    """Read the echoes of one channel of an echo sounder's raw file.

    Parameters
    ----------
    path : str or path
        A .raw file of the EK80's format.
    channel : str, optional
        Name of the channel, as in the attribute ``channels``.
    frequency : float, optional [Hz]
        Selects the channel whose transducer is made for that frequency, within a tenth. Without a choice the first
        channel with pings is read, with a warning if there are others.
    pings : slice, optional
        Consecutive pings of the channel to read, counted from 0; bounds the memory. The default is all.

    Returns
    -------
    xarray.Dataset
        ``level`` (ping, range) [dB re 1 W]: received power, NaN behind the last sample of a ping. Where the beam is
        split, ``angle_along`` and ``angle_athwart`` (ping, range) [rad], ahead and to starboard of the axis. Where the
        file has signals, ``signal`` (ping, rx, range) [V], complex64, and for chirps ``replica``, with which levels and
        angles are compressed. Coordinates: ``ping``, ``range`` [m],
        ``ping_time`` [s since 1970], and over ping ``longitude``, ``latitude`` [degrees], ``heave`` [m], ``roll``,
        ``pitch``, ``heading`` [rad] as recorded, ``transmit_power`` [W]. Attributes: frequencies, pulse, environment,
        and calibration of the file.

    Raises
    ------
    FileNotFoundError, PermissionError
        If there is no such file, or it may not be read.
    ValueError
        If the file is of another format, is damaged, lacks the channel or the pings, or the pulse or the sample
        interval changes between the pings.

    Examples
    --------
    ``mitsonar.io.echo_sounder_lines.read("line.raw", frequency=38e3)["level"]``
    """
    check_readable(path, "the echo sounder's file", "a .raw file")
    some = pings or slice(None)
    if some.step not in (None, 1) or (some.start or 0) < 0 or some.stop is not None and some.stop <= (some.start or 0):
        raise ValueError(f"the pings to read of {path} are {pings}; give a slice from a first ping, counted from 0, to "
                         "a later one.")
    try:
        with open(path, "rb") as file:
            line = _walked(file)
            name = _chosen(path, line, channel, frequency)
            wanted = [(ping, about) for ping, own, about in line.pings if own == name]
            if not wanted[some]:
                raise ValueError(f"channel {name} has {len(wanted)} pings, and none of those asked for; give others.")
            return _image(path, file, line, name, wanted[some])
    except ValueError as error:
        raise ValueError(f"cannot read the echo sounder's file {path}: {error}") from None


def _walked(file) -> _SounderFile:
    line, parameters = _SounderFile(), {}
    if not recognised(file.read(8)):
        raise ValueError("it does not begin with a configuration (XML0); give a raw file of an EK80.")
    for datagram in datagrams.walk(file):
        if datagram.kind == "XML0":
            _take(line, datagrams.tree(file, datagram), parameters)
        elif datagram.kind == "RAW3":
            name = _name(datagrams.content(file, datagram, 128))
            line.pings.append((datagram, name, parameters.get(name, {})))
        elif datagram.kind == "FIL1":
            raw = datagrams.content(file, datagram, MOST_FILTER)
            own = Filter.of(raw, datagram.at)
            line.filters.setdefault(_name(raw[4:132]), {})[own.stage] = own
        elif datagram.kind in ("NME0", "MRU0"):
            (line.sentences if datagram.kind == "NME0" else line.motion).append(datagram)
        line.others[datagram.kind] += datagram.kind not in _KNOWN
        if len(line.pings) + len(line.sentences) + len(line.motion) > MOST_LINES:
            raise ValueError(f"it holds more than {MOST_LINES:,} pings and sentences; split it.")
    return line


def _name(raw):
    return raw.split(b"\0")[0].decode("latin-1").strip()


def _take(line, element, parameters):
    """Take what an XML datagram says into the line, or into the parameters of the next pings."""
    if element.tag == "Configuration":
        for transceiver in element.iter("Transceiver"):
            for own in transceiver.iter("Channel"):
                line.channels[own.get("ChannelID", "")] = _channel(transceiver, own)
    elif element.tag == "Environment":
        transducer = element.find("Transducer")
        line.environment = {name: datagrams.number(element, name)
                            for name in ("SoundSpeed", "Temperature", "Salinity", "Depth")}
        line.environment["Transducer"] = datagrams.number(transducer, "SoundSpeed")
    elif element.tag == "Parameter":
        for own in element.iter("Channel"):
            parameters[own.get("ChannelID", "")] = {name: datagrams.number(own, name) for name in (
                "PulseForm", "Frequency", "FrequencyStart", "FrequencyEnd", "PulseDuration", "PulseLength",
                "SampleInterval", "TransmitPower", "Slope")}


def _channel(transceiver, own):
    """Return the attributes of a channel: its transducer and its calibration at the nominal frequency."""
    transducer = own.find("Transducer")
    found: dict[str, object] = {
        "frequency": datagrams.number(transducer, "Frequency"), "impedance": datagrams.number(transceiver, "Impedance"),
        "transceiver": transceiver.get("TransceiverType", ""),
        "transducer": "" if transducer is None else transducer.get("TransducerName", "")}
    found |= {name: datagrams.number(transducer, key) for key, name in _NUMBERS.items()}
    found |= {name: float(np.deg2rad(datagrams.number(transducer, key))) for key, name in _ANGLES.items()}
    for key, source, name in (("PulseDuration", own, "pulse_lengths"), ("Gain", transducer, "gains_db"),
                              ("SaCorrection", transducer, "area_corrections_db")):
        found[name] = _list("" if source is None else source.get(key, ""))
    return found


def _list(words):
    try:
        return [float(word) for word in words.split(";") if word]
    except ValueError:
        return []


def _chosen(path, line, channel, frequency):
    """Return the name of the channel to read."""
    used = list(dict.fromkeys(name for _, name, _ in line.pings))
    every = ", ".join(f"{name} ({line.channels.get(name, {}).get('frequency', np.nan) / 1e3:g} kHz)" for name in used)
    if not used:
        raise ValueError("it has no pings; give another file.")
    if channel is not None and frequency is not None:
        raise ValueError("a channel and a frequency were asked for; give one of them.")
    if channel is not None:
        if channel not in used:
            raise ValueError(f"channel {channel} was asked for, and it has {every}; give one of these.")
        return channel
    if frequency is not None:
        off = {name: abs(line.channels.get(name, {}).get("frequency", np.nan) - frequency) for name in used}
        name = min(used, key=lambda name: np.nan_to_num(off[name], nan=np.inf))
        if not off[name] <= 0.1 * frequency:
            raise ValueError(f"{frequency / 1e3:g} kHz was asked for, and it has {every}; give one of these.")
        return name
    if len(used) > 1:
        warnings.warn(f"{path} has several channels, and the first with pings was read: {every}.", stacklevel=4)
    return used[0]


def _image(path, file, line, name, wanted):
    about = line.channels.get(name, {})
    pulse = wanted[0][1]
    for number, (_, other) in enumerate(wanted):
        changed = [key for key in ("PulseForm", "Frequency", "FrequencyStart", "FrequencyEnd", "SampleInterval")
                   if not np.array_equal(pulse.get(key, np.nan), other.get(key, np.nan), equal_nan=True)]
        if changed:
            raise ValueError(f"{changed[0]} of channel {name} changes at ping {number} of those asked for; read the "
                             f"pings before and after it by themselves, such as pings=slice(0, {number}).")
    interval = pulse.get("SampleInterval", np.nan)
    if not 0 < interval < 1:
        raise ValueError(f"channel {name} has no sample interval; the file is damaged.")
    speed = next((line.environment[key] for key in ("SoundSpeed", "Transducer")
                  if 1000 < line.environment.get(key, np.nan) < 2000), 1500.0)
    sent = None
    if pulse.get("PulseForm") == FM:
        sent = replica(list(line.filters.get(name, {}).values()), first=pulse["FrequencyStart"],
                       last=pulse["FrequencyEnd"], length=_length(pulse), slope=pulse["Slope"], interval=interval)
    level, angles, signal = _arrays(file, wanted, about, pulse, sent)
    time = np.array([ping.time for ping, _ in wanted])
    dims = ("ping", "range")
    variables = dict[str, tuple[Any, ...]]()
    variables["level"] = dims, level, {"units": "dB re 1 W", "long_name": "received power"}
    for way, words, values in zip(("along", "athwart"), ("ahead", "to starboard"), angles or (), strict=False):
        long_name = f"direction of the echo, {words} of the axis"
        variables[f"angle_{way}"] = (dims, values, {"units": "rad", "long_name": long_name})
    if sent is not None and signal is not None:
        variables["replica"] = ("replica_sample", sent.astype(np.complex64),
                                {"units": "1", "long_name": "pulse that chirps are compressed with"})
    if signal is not None:
        variables["signal"] = (("ping", "rx", "range"), signal, {"units": "V", "long_name": "signals of the sectors"})
    attrs = {"sonar": "echo_sounder", "looks": "down", "sound_speed": speed, "source": os.path.basename(path),
             "format": "ek80", "channel": name, "channels": list(dict.fromkeys(own for _, own, _ in line.pings)),
             **{key: value for key, value in about.items() if not (isinstance(value, float) and np.isnan(value))},
             **_pulse(pulse, about), "bin_width": 0.5 * speed * interval, "sample_interval": interval,
             "environment": {key: value for key, value in line.environment.items() if np.isfinite(value)},
             "left_out": [f"{count} datagrams of type {kind}" for kind, count in sorted(line.others.items()) if count]}
    return SonarImage.of(xr.Dataset(
        variables,
        coords={"ping": np.arange(len(wanted)), "ping_time": ("ping", time, {"units": "s"}),
                "range": ("range", np.arange(level.shape[1]) * 0.5 * speed * interval, {"units": "m"}),
                "time": ("range", np.arange(level.shape[1]) * interval, {"units": "s"}),
                "transmit_power": ("ping", [own.get("TransmitPower", np.nan) for _, own in wanted], {"units": "W"}),
                **_navigation(file, line, time)}, attrs=attrs))


def _pulse(pulse, about):
    """Return the attributes of the pulse, with the gain for its length."""
    length = _length(pulse)
    found = dict[str, Any]()
    found["pulse_form"] = "FM" if pulse.get("PulseForm") == FM else "CW"
    if np.isfinite(length):
        found["pulse_length"] = length
    band = [pulse.get(key, np.nan) for key in ("FrequencyStart", "FrequencyEnd")]
    if np.isfinite(band).all():
        found |= {"frequency_start": band[0], "frequency_end": band[1]}
    elif np.isfinite(pulse.get("Frequency", np.nan)):
        found["frequency"] = pulse["Frequency"]
    lengths = about.get("pulse_lengths") or []
    at = [number for number, known in enumerate(lengths) if abs(known - length) < 1e-3 * known]
    for name, own in (("gain_db", "gains_db"), ("area_correction_db", "area_corrections_db")):
        if at and at[0] < len(about[own]):
            found[name] = about[own][at[0]]
    return found


def _length(pulse):
    """Return the length of a pulse [s], NaN if it is not known."""
    return next((pulse[key] for key in ("PulseDuration", "PulseLength") if 0 < pulse.get(key, np.nan) < 1), np.nan)


def _arrays(file, wanted, about, pulse, sent):
    """Return level, angles (along, athwart) or None, and signals or None, of pings."""
    counts = [np.frombuffer(datagrams.content(file, ping, datagrams.RAW.itemsize).ljust(140, b"\0"), datagrams.RAW)[0]
              for ping, _ in wanted]
    widest, sectors = max(int(own["count"]) for own in counts), int(counts[0]["kind"]) >> 8
    if len({int(own["kind"]) for own in counts}) > 1:
        raise ValueError("its samples change from power to signals, or their sectors in number; read a part of the "
                         "pings.")
    if widest < 2:
        raise ValueError("its pings have fewer than two samples; give another file.")
    if (total := len(counts) * widest * (12 + 8 * sectors)) > MOST_BYTES:
        raise ValueError(f"its samples take {total / 1e9:.3g} GB, and at most {MOST_BYTES / 1e9:g} GB are read at "
                         "once; give a range of its pings, such as pings=slice(0, 1000).")
    level = np.full((len(counts), widest), np.nan, np.float32)
    signal = np.zeros((len(counts), sectors, widest), np.complex64) if sectors else None
    beam = about.get("beam_type", np.nan)
    beam = 0 if np.isnan(beam) else int(beam)
    angles = None
    for number, (ping, _) in enumerate(wanted):
        if ping.size > datagrams.MOST_PING:
            raise ValueError(f"the ping at byte {ping.at} has {ping.size / 1e6:.0f} MB; the file is damaged there.")
        power, steps, voltage = datagrams.samples(datagrams.content(file, ping), ping.at)
        electrical = None
        if voltage is not None and signal is not None:
            signal[number, :, :len(voltage)] = voltage.T
            receiver = about.get("impedance", np.nan)
            found = voltage.T if sent is None else compressed(voltage.T, sent)
            level[number, :len(voltage)] = split_beams.power_db(found, receiver if receiver > 0 else 1000.0)
            # without its pulse a chirp stays uncompressed, and directions of its echoes are mixed
            electrical = None if pulse.get("PulseForm") == FM and sent is None else split_beams.electrical(found, beam)
        elif power is not None:
            level[number, :len(power)] = power * split_beams.STEP_DB
        if steps is not None and beam:
            electrical = steps[:, 1] * split_beams.STEP, steps[:, 0] * split_beams.STEP
        if electrical is not None:
            if angles is None:
                angles = tuple(np.full(level.shape, np.nan, np.float32) for _ in range(2))
            for way, into, phase in zip(("along", "athwart"), angles, electrical, strict=True):
                into[number, :len(phase)] = phase / about[f"angle_sensitivity_{way}"] - about[f"angle_offset_{way}"]
    return level, angles, signal


def _navigation(file, line, time):
    """Return positions and attitude at the pings, as far as the file has them."""
    fixes = [(own.time, fix) for own in line.sentences if (fix := fix_of(datagrams.content(file, own, 200)))]
    clock = np.array([stamp for stamp, _ in fixes])
    found = {}
    for number, name in enumerate(("latitude", "longitude")):
        if fixes:
            found[name] = "ping", at_times(time, clock, np.array([fix[number] for _, fix in fixes])), {
                "units": "degrees"}
    size = datagrams.MOTION.itemsize
    motion = np.array([np.frombuffer(raw, datagrams.MOTION, 1)[0] for own in line.motion
                       if len(raw := datagrams.content(file, own, size)) == size], datagrams.MOTION)
    clock = np.array([own.time for own in line.motion if own.size >= size])
    for name in datagrams.MOTION.names or ():
        if motion.size:
            values = motion[name].astype(float)
            values = values if name == "heave" else np.unwrap(np.deg2rad(values))
            measured = at_times(time, clock, values)
            found[name] = ("ping", measured % (2 * np.pi) if name == "heading" else measured,
                           {"units": "m" if name == "heave" else "rad"})
    return found
