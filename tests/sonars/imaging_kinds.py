"""Every imaging sonar there is, kind by kind and preset by preset, described to the tests that hold for all of them.

A new preset is a member by itself. A new kind must be described here or, where its picture has no bearings, have a file
of tests of its own: `members` says so.
"""
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import sonar_scenes as scenes
from scipy.optimize import brentq

from mitsonar.sonar.preset_tables import TABLES, presets

SPEED = 1500.0
LINE = {"frequency_khz": 300.0, "receive": "line", "receive_elements": 64, "receive_normal": "forward",
        "receive_baffle": "hard", "transmit_normal": "forward", "transmit_baffle": "hard", "receive_shading": "hamming",
        "pulse": "lfm", "bandwidth_khz": 30.0, "pulse_ms": 0.3}
COARSE = {"frequency_khz": 200.0, "bandwidth_khz": 20.0, "pulse_ms": 0.3}


@dataclass(frozen=True, kw_only=True)
class Member:
    """A kind of imaging sonar with a preset.

    Attributes
    ----------
    build : callable
        Of `sonar_scenes`.
    sensor, coarse : dict
        Attributes of the sensor; more of them for pictures of few and large cells.
    fan : callable
        Width [degrees] and directions of the picture to attributes that make it so.
    width : callable
        Sensor to the -3 dB width [rad] of a far point straight ahead.
    """

    name: str
    build: Callable[..., Any]
    sensor: dict[str, Any]
    coarse: dict[str, Any]
    fan: Callable[[float, int], dict[str, Any]]
    width: Callable[[Any], float]

    def made(self, shapes: dict[str, Any], *, fan: tuple[float, int], coarse: bool = False, **parts: Any) -> Any:
        """The scene of a picture `fan` (degrees, directions) wide; parts as of `sonar_scenes`."""
        sensor = {**self.sensor, **(self.coarse if coarse else {}), **self.fan(*fan), **parts.pop("sensor", {})}
        return self.build(shapes, sensor=sensor, **parts)


def members(first_of_kind: bool = False) -> Iterator[Member]:
    """Every member, or one of each kind."""
    from mitsonar.survey.kinds import KINDS
    unknown = [kind for kind in KINDS if kind not in _KINDS and not [*Path(__file__).parent.glob(f"test_{kind}*.py")]]
    assert not unknown, f"no test knows {', '.join(unknown)}; describe the kind in tests/sonars/imaging_kinds.py"
    for kind, member in _KINDS.items():
        names = [*presets(kind)] if kind in TABLES else [""]
        for preset in names[:1] if first_of_kind else names:
            yield member(preset)


def pulse_width(pulse: Any) -> float:
    """-3 dB width [m] of a compressed pulse, |∫ s(u + t) s*(u) du|²."""
    time = np.linspace(0, pulse.duration, 20001)
    spectrum = np.fft.fft(pulse.envelope(time), 1 << 16)
    peak = np.abs(np.fft.ifft(np.abs(spectrum) ** 2))[:20000] ** 2
    half = int(np.argmax(peak < 0.5 * peak[0]))
    return SPEED * time[1] * (half - 1 + (peak[half - 1] - 0.5 * peak[0]) / (peak[half - 1] - peak[half]))


def _line_width(sensor: Any) -> float:
    """Of Σ w e^(i2π x sin ψ / λ) of the receivers, about ψ = 0."""
    x, weight = sensor.receive.position[:, 1], sensor.receive.weight
    wavenumber = 2 * np.pi * sensor.frequency / SPEED

    def level(psi: float) -> float:
        heard = np.abs(weight @ np.exp(1j * wavenumber * (x - x.mean()) * np.sin(psi)))
        return float(heard / weight.sum() - 0.5 ** 0.5)
    return 2 * float(brentq(level, 0, SPEED / sensor.frequency / np.ptp(x)))


def _face_width(sensor: Any) -> float:
    """Of sinc⁴(L sin ψ / λ), whose sinc² is as wide as the beam."""
    two_way, one_way = (float(brentq(lambda x, power=power: float(np.sinc(x)) ** power - 0.5, 1e-3, 0.99))
                        for power in (4, 2))
    return 2 * np.arcsin(np.sin(0.5 * sensor.beam_widths[0]) * two_way / one_way)


def _forward_looking(preset: str) -> Member:
    own = presets("forward_looking")[preset]
    whole = {"preset": preset, "tilt_deg": 0.0, "transmit_beam_width_deg": own["fan_deg"]}
    return Member(name=f"forward_looking {preset}", build=scenes.forward_looking, sensor=whole, width=_line_width,
                  coarse={**COARSE, "pulse": "lfm", "receive_elements": 32, "element_spacing": 0.5},
                  fan=lambda degrees, count: {"fan_deg": degrees, "beams": count})


def _sector_scan(preset: str) -> Member:
    return Member(name=f"sector_scan {preset}", build=scenes.sector_scan, width=_face_width,
                  sensor={"preset": preset, "turns_while_listening": False},
                  coarse={**COARSE, "beam_width_deg": 5.0},
                  fan=lambda degrees, count: {"sector_deg": degrees, "step_deg": degrees / (count - 1), "pings": count})


def _array(preset: str) -> Member:
    return Member(name="array line", build=scenes.array_sonar, sensor=LINE, width=_line_width, coarse=COARSE,
                  fan=lambda degrees, count: {"fan_deg": degrees, "beams": count})


def _multibeam(preset: str) -> Member:
    """One sector of narrow beams and a short pulse, the head turned so that its swath lies ahead."""
    own = presets("multibeam")[preset]
    ahead = {"mounting_deg": "0, 90, 0", "transmit_beam_width_deg": 20.0, "roll_stabilised": False,
             "pitch_stabilised": False, "beam_spacing": "angle", "sector_edges_deg": "", "swaths": 1,
             **{name: own[name][0] for name in ("frequency_khz", "source_level_db", "sector_delay_ms")}}
    ahead["receive_beam_width_deg"] = min(own["receive_beam_width_deg"], 1.0)
    ahead["pulse_ms"] = min(own["pulse_ms"][0], 0.1) if own["pulse"] == "cw" else own["pulse_ms"][0]
    if own["pulse"] != "cw":
        ahead["bandwidth_khz"] = own["bandwidth_khz"][0]
    return Member(name=f"multibeam {preset}", build=scenes.multibeam, sensor={"preset": preset, **ahead},
                  width=_line_width, coarse={**COARSE, "pulse": "lfm", "receive_beam_width_deg": 5.0},
                  fan=lambda degrees, count: {"swath_deg": degrees, "beams": count})


_KINDS: dict[str, Callable[[str], Member]] = {"forward_looking": _forward_looking, "sector_scan": _sector_scan,
                                             "array": _array, "multibeam": _multibeam}
