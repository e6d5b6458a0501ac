"""Backscatter strength computed back from element signals: mean energy of one element's responses above a bed."""
from functools import partial

import numpy as np

from mitsonar.scattering.laws.strength import backscatter_strength_db
from mitsonar.water.profile import SoundSpeedProfile

from .. import scenes
from ..case import Case, Compared, Curve, Panel, Table, worst
from ..sonar_equation import FlatBed
from .rays import SUMMER

SONAR_DEPTH, BED_DEPTH, RANGE, FREQUENCY = 12.0, 22.0, 116.0, 100e3                   # [m], [Hz]
GATES = 2 / 1500.0 * np.r_[10.5, 13.0, 16.0, 20.0, 25.0, 32.0, 40.0, 50.0, 64.0, 80.0, 98.0, 114.0]   # [s], two-way
ABSORPTION = 0.0334                                # [dB/m]
WATERS = {"uniform": SoundSpeedProfile.constant(1500.0), "summer": SUMMER}
ENSONIFICATIONS = {"scatterers": {"cell": 0.25}, "rays": {"cell": 0.25, "ensonification": "rays", "rays": 1_000_000}}
RUNS = [(water, sediment, ensonified_by) for water in WATERS for sediment in ("medium sand", "silt")
        for ensonified_by in ENSONIFICATIONS if ensonified_by == "scatterers" or sediment == "medium sand"]
ALLOWED, ALLOWED_MEAN = 0.2, 0.05                  # [dB]


def _energy(water, sediment, ensonified_by, seeds):
    """Return the mean energy of the response in the gates (gate,), over beds whose scatterers differ."""
    import mitsonar

    total = 0
    for seed in range(seeds):
        scene = scenes.array_sonar(
            {f"bed {seed}": scenes.bed(BED_DEPTH, scenes.sediment(sediment), size=2.1 * RANGE)}, depth=SONAR_DEPTH,
            water={**scenes.water_of(WATERS[water]), "absorption_db_per_km": 1e3 * ABSORPTION},
            sensor={"frequency_khz": FREQUENCY / 1e3}, film={"range": RANGE, "sample_rate_khz": 1000.0},
            integrator=ENSONIFICATIONS[ensonified_by])
        response = mitsonar.impulse_response(scene, kernel="nearest")
        # float64, because the histogram sums from the first sample on, which is stronger by a million
        power = np.abs(response.values[0, 0, 0].astype(complex)) ** 2
        total = total + np.histogram(response["time"].values, GATES, weights=power)[0]
    return total / seeds


def _run(quick):
    rows, lines = [], []
    for water, sediment, ensonified_by in RUNS:
        if quick and (water, sediment) != ("summer", "medium sand"):
            continue
        profile = WATERS[water]
        speed = float(profile.at(BED_DEPTH))
        law = partial(backscatter_strength_db, "sediment", frequency=FREQUENCY, sediment=sediment, sound_speed=speed)
        bed = FlatBed.of(profile, SONAR_DEPTH, BED_DEPTH, 1.05 * RANGE)
        expected = bed.energy(GATES, lambda angle, law=law: 10 ** (law(angle) / 10), ABSORPTION, 2 * np.pi)
        error = 10 * np.log10(_energy(water, sediment, ensonified_by, 1 if quick else 4) / expected)
        error = error[np.isfinite(expected)]
        grazing = bed.grazing_at(0.5 * (GATES[1:] + GATES[:-1]))[np.isfinite(expected)]
        strength = law(grazing)
        name = f"{water} water, {sediment}, ensonified by {ensonified_by}"
        rows += [worst(f"{name}, gates", strength + error, strength, ALLOWED, "dB"),
                 Compared(f"{name}, their mean", float(np.mean(error)), 0.0, ALLOWED_MEAN, "dB")]
        lines += [Curve(name, np.degrees(grazing), strength), Curve(name, np.degrees(grazing), strength + error, ".")]
    return Table(tuple(rows), (Panel("100 kHz, gates of two-way time", "grazing angle [deg]",
                                     "backscatter strength [dB]", tuple(lines)),))


CASE = Case(title="Backscatter strength from element signals", run=_run, text=(
    "An omnidirectional element 10 m above a flat bed of scatterers with complex Gaussian amplitudes: energy of its "
    "impulse responses in gates of time, over the sonar equation integrated over exact eigenrays with the law of the "
    "sediment, reduced to a strength. Several beds, whose scatterers differ, have cells of 0.25 m, ensonified by "
    "connecting each to the element, or by rays. The rest is speckle: 0.05 dB rms in the gate of fewest scatterers."))
