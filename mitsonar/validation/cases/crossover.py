"""Range at which noise exceeds reverberation, from a sidescan's levels and by the sonar equation."""
import numpy as np

from mitsonar.scattering.laws.strength import backscatter_strength_db
from mitsonar.water.absorption import absorption_db
from mitsonar.water.noise import ambient_noise_db
from mitsonar.water.profile import SoundSpeedProfile

from .. import scenes
from ..case import Case, Compared, Curve, Panel, Table, root_of
from ..sonar_equation import FlatBed

SONAR_DEPTH, BED_DEPTH, SPEED = 20.0, 40.0, 1500.0         # [m], [m/s]
CASES = {  # kHz, wind [m/s], sediment, source level [dB], pulse [ms], farthest range [m]
    "100 kHz, silt": (100, 10.0, "silt", 205.0, 0.1, 400.0),
    "300 kHz, medium sand": (300, 5.0, "medium sand", 205.0, 0.05, 250.0),
    "30 kHz, coarse sand": (30, 5.0, "coarse sand", 190.0, 0.5, 600.0)}
BINS, WINDOW = 600, 20                             # bins averaged to either side


def _levels(name, pings):
    """Return slant ranges [m], intensities (bin,) of the chain and of the sonar equation, and the noise [µPa²]."""
    import mitsonar
    from mitsonar.survey.sidescan.kind import sonar_at

    khz, wind, sediment, source, pulse, farthest = CASES[name]
    scene = scenes.sidescan(
        {"bed": scenes.bed(BED_DEPTH, scenes.sediment(sediment), size=4 * farthest)}, depth=SONAR_DEPTH, rays=100_000,
        pings=pings, sensor={"frequency_khz": float(khz), "source_level_db": source, "pulse_ms": pulse,
                             "vertical_beam_width_deg": 60.0, "speckle": True, "noise": True},
        water={"sound_speed": SPEED, "wind_speed": wind, "absorption_db_per_km": _loss(khz) * 1e3},
        film={"range": farthest, "range_min": 25.0, "bins": BINS})
    image = mitsonar.render(scene, seed=6)
    sonar, time = sonar_at(scene.sensors()[0], SONAR_DEPTH), image["time"].values
    half = 0.5 * (time[1] - time[0])
    rays = FlatBed.of(SoundSpeedProfile.constant(SPEED), SONAR_DEPTH, BED_DEPTH, farthest)

    def law(angle: np.ndarray) -> np.ndarray:
        return 10 ** (backscatter_strength_db("sediment", angle, 1e3 * khz, sediment=sediment) / 10)

    # in the face's own angles, for rays straight abeam
    across = sonar.across_intensity(np.sin(rays.launch - sonar.depression_angle))
    expected = 10 ** (source / 10) * min(1.0, 1e-3 * pulse / (2 * half)) * rays.energy(
        np.append(time - half, time[-1] + half), law, _loss(khz), across * rays.beam_azimuths(sonar.along_intensity))
    noise_db = float(ambient_noise_db(1e3 * khz, wind) - 10 * np.log10(1e-3 * pulse) - sonar.directivity_index_db())
    recorded = np.mean(10 ** (image["level"].values.astype(float) / 10), axis=(0, 1))
    return image["range"].values, recorded, expected, 10 ** (noise_db / 10)


def _loss(khz):
    """Return the absorption [dB/m]."""
    return float(absorption_db(1e3 * khz))


def _run(quick):
    rows, panels = [], []
    for name in list(CASES)[:1] if quick else CASES:
        r, recorded, expected, noise = _levels(name, 100 if quick else 400)
        smooth = np.convolve(recorded, np.ones(2 * WINDOW + 1) / (2 * WINDOW + 1), "valid")
        there = slice(WINDOW, -WINDOW)
        wanted = np.convolve(expected, np.ones(2 * WINDOW + 1) / (2 * WINDOW + 1), "valid")
        crossing = [_crossing(r[there], excess) for excess in (smooth - 2 * noise, wanted - noise)]
        tail = recorded[r > 0.95 * r[-1]]
        last = noise + np.mean(expected[r > 0.95 * r[-1]])
        got, wanted = crossing
        rows += [Compared(f"{name}: range at which reverberation is as strong as noise", got, wanted, 0.01 * wanted,
                          "m"),
                 Compared(f"{name}: level of the last bins", float(10 * np.log10(np.mean(tail))),
                          float(10 * np.log10(last)), 0.1, "dB")]
        panels.append(Panel(name, "slant range [m]", "dB re 1 µPa", (
            Curve("chain", r, 10 * np.log10(recorded), "."), Curve("reverberation", r, 10 * np.log10(expected)),
            Curve("noise", r[[0, -1]], [10 * np.log10(noise)] * 2),
            Curve("crossover", [crossing[1]] * 2, 10 * np.log10([0.3 * noise, 10 * noise])))))
    return Table(tuple(rows), tuple(panels))


def _crossing(r, excess):
    """Return the last range at which a curve falls through 0, interpolated between bins."""
    k = np.flatnonzero(excess > 0)[-1]
    return root_of(lambda place: float(np.interp(place, r[k:k + 2], excess[k:k + 2])), r[k], r[k + 1])


CASE = Case(title="Reverberation to noise", run=_run, text=(
    "A sidescan with speckle and noise on, 20 m above a flat bed: the slant range at which mean reverberation equals "
    "noise, once where the recorded mean intensity is twice the noise, and once by the sonar equation integrated over "
    "the bed against NL + 10 log B - DI (Wenz 1962; B the inverse of the pulse length, DI of the receiving face), both "
    "smoothed over 41 bins. The allowed error is 1 % of the range, and 0.1 dB of level at the end of the record."))
