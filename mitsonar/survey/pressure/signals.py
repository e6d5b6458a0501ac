"""Impulse responses and signals of an array survey's pings, as labelled arrays.

    h[tx, rx](t)    pressure at rx per unit pressure of tx at 1 m [-], complex baseband
    s[rx](t) = ε_rx (10^(SL/20) Σ_tx w_tx (h[tx, rx] * s_b)(t - τ_tx) + noise)                              [µPa]

SL -> source level, ε_rx -> channel of the receiver, w_tx and τ_tx -> weight and delay of the transmit elements, with Σ
|w_tx| = 1, s_b -> envelope of the pulse. The level is that of the steered transmission on its axis. Squares are mean
squares, without a factor √2.

The Doppler factors of a ping's echoes are bounded by the closing speed u of elements and echoes:

    -v <= u <= v                                                v -> speed of the fastest element, and of objects
    min, max of v·d over directions d of the beams, ± v β       if side lobes are thinned

The beams are all directions in which `ElementBeams.bound` exceeds the intensity below which cells are thinned. They are
searched on a Fibonacci lattice of N points; every direction is within β of one of them. Echoes from outside the beams
are weaker and belong to the outermost class: their level, delay and mid frequency are right, the ends of a sweep not.
"""
from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
import xarray as xr

from mitsonar.device.arrays import upload
from mitsonar.device.progress import Done, Share, each_of, nobody, shares
from mitsonar.echoes.scatterers.element_beams import ElementBeams
from mitsonar.signal.doppler import Glide, doppler_classes, glide_of, pieces_of, two_way_doppler
from mitsonar.signal.reception import absorbed, check_record, delayed, received
from mitsonar.sonar.pulses.pulses import Pulse
from mitsonar.units import amplitude_from_db

from .array_survey import ArraySurvey
from .cost import sentence
from .delays import ArrivalCounts
from .pressure import PingPressure, PressureRecord

DIRECTIONS = 1 << 14               # N
APART = 4.0 / np.sqrt(DIRECTIONS)  # β [rad], a generous upper bound of the distance to the next point
GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))
LEAD = 1.05                        # [pulse lengths] by which records must begin early: a slow Doppler factor stretches
NEAREST = 1.0                      # [m]: nearer echoes do not affect the number of pieces of a pulse

Say = Callable[[str], None]


def closing_speeds(survey: ArraySurvey, ping: int, *, fastest: float, acceleration: float,
                   nearest: float) -> tuple[float, float]:
    """Return the least and the largest closing speed of a ping's echoes, one way [m/s]."""
    # fastest [m/s]; acceleration [m/s²], of the fastest element; nearest [m], least range of relevant echoes
    beams = ElementBeams(survey.transmit, survey.receive, survey.within(ping).wavelength)
    if not (survey.thin_below and beams):
        return -fastest, fastest
    direction = lattice()
    bound = beams.bound(mi.Vector3f(*(upload(mi.Float, column.astype(np.float32)) for column in direction.T)),
                        dr.opaque(mi.Float, nearest), survey.track.rotation()[ping], dr.opaque(mi.Float, APART))
    within = direction[bound.numpy() > survey.thin_below]
    if not len(within):
        return -fastest, fastest
    velocity = survey.velocity[ping]
    along = within @ velocity
    # elements also turn, and the platform accelerates
    spare = (fastest * APART + (fastest - float(np.linalg.norm(velocity)))
             + acceleration * (survey.time[-1] + survey.pulse.duration))
    return max(float(along.min()) - spare, -fastest), min(float(along.max()) + spare, fastest)


@lru_cache(maxsize=1)
def lattice() -> np.ndarray:
    """Return evenly distributed directions (N, 3) of a Fibonacci lattice."""
    number = np.arange(DIRECTIONS) + 0.5
    height, angle = 1 - 2 * number / DIRECTIONS, GOLDEN_ANGLE * number
    level = np.sqrt(1 - height ** 2)
    return np.stack([level * np.cos(angle), level * np.sin(angle), height], 1)


def pair_responses(record: PressureRecord, pings: Sequence[int], *, progress: Done | None = None,
                   say: Say | None = None) -> xr.DataArray:
    """Return the impulse responses of every pair of elements (ping, tx, rx, sample)."""
    survey = record.survey
    _say_cost(say, record, pings, all_transmit=True)
    blocks, now = [], None
    whole = shares(progress, len(pings) * survey.transmit.elements)
    for number, ping in enumerate(pings):
        now = record.at(ping, now)
        blocks.append(now.responses(each_of(whole, number, len(pings))))
    values = np.stack(blocks)
    values[:, ~survey.transmit.working] = 0
    values[:, :, ~survey.receive.working] = 0
    _warn_of_lost(record.counts)
    return _labelled(values, survey, pings, name="impulse response", unit="1", lost=record.counts.lost,
                     transmitters=True)


def received_signals(record: PressureRecord, pings: Sequence[int], *, progress: Done | None = None,
                     say: Say | None = None) -> xr.DataArray:
    """Return the signals of every receive element (ping, 1, rx, sample); the record must begin `LEAD` early."""
    survey, kept = record.survey, record.survey.samples - record.survey.lead
    try:
        check_record(survey.pulse, survey.sampling_rate, kept)
    except ValueError as error:
        raise ValueError(f"{error} In a scene, sample_rate_khz or bins of the film set the rate, and its range sets "
                         "the length of the record.") from None
    _say_cost(say, record, pings)
    blocks, now, whole = [], None, shares(progress, len(pings))
    for number, ping in enumerate(pings):
        now = record.at(ping, now)
        within = each_of(whole, number, len(pings))
        signals = amplitude_from_db(survey.source_level_db) * echoes_of_the_pulse(now, within)
        if survey.noise is not None:
            signals = signals + survey.noise.drawn(survey.samples, record.seed, int(ping))
        if not survey.receive.flawless:
            signals = signals * survey.receive.channel[:, None]
        if survey.receive.delay.any():
            signals = delayed(signals, survey.receive.delay, survey.sampling_rate, survey.frequency)
        signals[~survey.receive.working] = 0
        blocks.append(signals[:, -kept:].astype(np.complex64))
        within(1.0)
    _warn_of_lost(record.counts)
    array = _labelled(np.stack(blocks)[:, None], survey, pings, name="element signals", unit="µPa",
                      lost=record.counts.lost, transmitters=False)
    return array.assign_attrs(seed=record.seed, source_level_db=survey.source_level_db)


def echoes_of_the_pulse(now: PingPressure, progress: Share = nobody) -> np.ndarray:
    """Return the sum of the pulse's echoes at a ping for a source level of 0 dB: complex64 (rx, sample)."""
    survey, ping = now.record.survey, now.ensonified.ping
    speed = survey.sound_speed(ping)
    absorption_db = survey.water_at(ping).mean_absorption_db
    signals = np.zeros((survey.receive.elements, survey.samples), np.complex64)      # there may be no echo
    pieces = sent_pieces(survey, ping)
    for number, sent in enumerate(pieces):
        within = each_of(progress, number, len(pieces))
        for factor, response in now.transmissions(sent.factors, piece=(sent.begin, sent.pulse), progress=within):
            if absorption_db is not None:
                # absorption follows the length of the way, which does not include the beginning of the piece
                response = absorbed(response, survey.sampling_rate, survey.frequency, absorption_db, speed,
                                    survey.start - sent.begin)
            signals = signals + received(response, sent.pulse, survey.sampling_rate, factor)
    return signals


class SentPiece(NamedTuple):
    """Piece of the pulse, its beginning [s], and the Doppler factors (K,) that represent its echoes."""

    begin: float
    pulse: Pulse
    factors: np.ndarray


def sent_pieces(survey: ArraySurvey, ping: int) -> list[SentPiece]:
    """Return the pulse in pieces so short that an echo has one Doppler factor for a whole piece."""
    speed = survey.sound_speed(ping)
    fastest, acceleration = _fastest(survey, ping)
    nearest = _nearest(survey, ping)
    pieces = survey.pulse.pieces(pieces_of(survey.pulse, fastest, speed, nearest, acceleration))
    low, high = closing_speeds(survey, ping, fastest=fastest, acceleration=acceleration, nearest=nearest)
    object_speed = survey.world.fastest(ping)
    closing = low - object_speed, high + object_speed
    return [SentPiece(begin, piece, _doppler_factors(piece, closing, speed,
                                                     glide_of(piece) if len(pieces) == 1 else None))
            for begin, piece in pieces]


def _say_cost(say: Say | None, record: PressureRecord, pings: Sequence[int], *, all_transmit: bool = False) -> None:
    """Report the expected cost, unless it is small."""
    if say is not None:
        cost = sentence(record, pings, threads=dr.thread_count(), all_transmit=all_transmit)
        if cost:
            say(cost)


def _warn_of_lost(counts: ArrivalCounts) -> None:
    """Warn of arrivals without a ray, at the line that called `mitsonar.element_signals` or a similar function."""
    if counts.lost:
        warnings.warn(f"{counts.lost:,} of {counts.arrivals:,} arrivals at elements are missing: the echoes reach the "
                      "array's centre, but no ray with at most one turning point reaches those elements", stacklevel=4)


def _labelled(values: np.ndarray, survey: ArraySurvey, pings: Sequence[int], *, name: str, unit: str,
              lost: int, transmitters: bool) -> xr.DataArray:
    """Return responses or signals (ping, tx, rx, sample) with their coordinates."""
    coords = {**ping_coordinates(survey, pings), "time": ("sample", survey.time[-values.shape[-1]:], {"units": "s"})}
    for prefix, array in (("tx", survey.transmit), ("rx", survey.receive))[0 if transmitters else 1:]:
        for axis, column in zip("xyz", array.position.T):
            coords[f"{prefix}_{axis}"] = (prefix, column, {"units": "m", "frame": "body: forward, starboard, down"})
    if not transmitters:
        coords["rx_weight"] = ("rx", survey.receive.weight, {"units": "1", "long_name": "shading for beamformers"})
        coords["rx_delay"] = ("rx", survey.receive.delay, {"units": "s", "long_name": "delay of the signals"})
    return xr.DataArray(values, dims=("ping", "tx", "rx", "sample"), coords=coords, name=name,
                        attrs={"units": unit, "lost_arrivals": lost, **ping_attributes(survey, pings)})


def ping_coordinates(survey: ArraySurvey, pings: Sequence[int]) -> dict[str, tuple | Sequence[int]]:
    """Return the coordinates of pings: position and attitude of the platform, and time."""
    track = survey.track
    coords: dict[str, tuple | Sequence[int]] = {"ping": pings}
    for axis, column in zip("xyz", track.position[pings].T):
        coords[axis] = ("ping", column, {"units": "m"})
    for angle in ("roll", "pitch", "heading"):
        coords[angle] = ("ping", getattr(track, angle)[pings], {"units": "rad"})
    coords["ping_time"] = ("ping", track.time[pings], {"units": "s"})
    return coords


def ping_attributes(survey: ArraySurvey, pings: Sequence[int]) -> dict:
    """Return the attributes of a record of pings."""
    return {"frequency": survey.frequency, "sampling_rate": survey.sampling_rate,
            "sound_speed": survey.sound_speed(pings[0]), "pulse": survey.pulse.numbers}


def _fastest(survey: ArraySurvey, ping: int) -> tuple[float, float]:
    """Return the speed of the fastest element [m/s] and its largest acceleration [m/s²] while echoes arrive."""
    travel = survey.travel(ping, np.zeros(3))
    moved, turned = ([float(travel.peak(powers, order)[0]) for order in (1, 2)]
                     for powers in (travel.displacement, travel.turn))
    # elements off the track's point move around it when the platform turns
    return moved[0] + turned[0] * survey.radius, moved[1] + (turned[1] + turned[0] ** 2) * survey.radius


def _nearest(survey: ArraySurvey, ping: int) -> float:
    """Return the least range of relevant echoes [m]: beginning of the record, or half the range of bed or surface."""
    beginning = 0.5 * survey.sound_speed(ping) * survey.time[survey.lead]
    return max(beginning, 0.5 * min(float(survey.depth_below[ping]), -survey.track.position[ping, 2]), NEAREST)


def _doppler_factors(pulse: Pulse, closing: tuple[float, float], speed: float, glide: Glide | None) -> np.ndarray:
    """Return the factors that represent all echoes of a ping; `closing` are the extreme closing speeds [m/s]."""
    if not any(closing):
        return np.ones(1)
    lowest, highest = (two_way_doppler(limit, speed) for limit in closing)
    return doppler_classes(pulse, lowest, highest, glide=glide)
