"""Backscatter strength computed back from the levels of a sidescan, by the sonar equation."""
import numpy as np

from mitsonar.scattering.laws.strength import backscatter_strength_db
from mitsonar.sonar.faces.directivity import HALF_POWER
from mitsonar.water.profile import SoundSpeedProfile

from .. import scenes
from ..case import Case, Compared, Curve, Panel, Table, worst
from ..sonar_equation import FlatBed
from .rays import SUMMER
from .sediments import KHZ, SIX, holding

SONAR_DEPTH, BED_DEPTH = 12.0, 22.0                # [m]
RANGE, BINS = 122.0, 1220
FLATTEST = np.radians(5.0)
ABSORPTION = {30: 0.0083, 100: 0.0334, 300: 0.0728}        # [dB/m]
WATERS = {
    "uniform": SoundSpeedProfile.constant(1500.0),
    "summer": SUMMER,                                      # rays bend down; no ray arrives flatter than 7 degrees
    "winter": SoundSpeedProfile([0, 8, 12, 16, 22, 40], [1480, 1481, 1484, 1490, 1500, 1503]),    # rays bend up
}
ALLOWED = 0.2                                              # [dB]
# a printed example: 220 dB, 100 kHz, pulse 0.1 ms, faces of 0.5 m, 20 m above the bed, 1500 m/s, 0.0334 dB/m:
# slant range at the end of the gate [m] -> level [dB re 1 µPa], both integrated in two dimensions
EXAMPLE = {"lambert -27 dB": {25: 121.48029, 40: 108.65570, 75: 92.19240, 100: 84.20113, 150: 72.00415},
           "medium sand": {25: 130.43265, 40: 120.10414, 75: 103.01261, 100: 93.96231, 150: 79.52979}}
GATE, EXAMPLE_ABSORPTION = 0.075, 0.03339952697        # [m], [dB/m]
POINTS = 60                                                # of a curve in the picture


def _example(name, rays):
    """Return the computed levels [dB] of the printed example, in the order of its slant ranges."""
    import mitsonar

    wavelength, got = 0.015, {}
    width = np.degrees(2 * np.arcsin(HALF_POWER * wavelength / 0.5))
    material = scenes.lambert(-27.0) if name.startswith("lambert") else scenes.sediment(name)
    for start in (0.0, GATE / 3):                          # with one of both, a bin ends at each range
        scene = scenes.sidescan(
            {"bed": scenes.bed(40.0, material)}, depth=20.0, rays=rays, pings=4,
            sensor={"source_level_db": 220.0, "beam_width_deg": width, "vertical_beam_width_deg": 180.0},
            water={"absorption_db_per_km": 1e3 * EXAMPLE_ABSORPTION},
            film={"range_min": start, "range": start + 2000 * GATE, "bins": 2000})
        image = mitsonar.render(scene)
        level = 10 * np.log10(np.mean(10 ** (image["mean_level"].values.astype(float) / 10), axis=(0, 1)))
        bins = {r: (r - start) / GATE - 1 for r in EXAMPLE[name]}
        got |= {r: level[round(place)] for r, place in bins.items() if abs(place - round(place)) < 1e-3}
    return [got[r] for r in EXAMPLE[name]]


def _strengths(water, khz, material, law, rays, pings, seed=1):
    """Return grazing angles [rad] of the bins, and strengths [dB] from their levels and by the law."""
    import mitsonar
    from mitsonar.survey.sidescan.kind import sonar_at

    profile = WATERS[water]
    scene = scenes.sidescan(
        {"bed": scenes.bed(BED_DEPTH, material)}, depth=SONAR_DEPTH, rays=rays, pings=pings,
        sensor={"frequency_khz": float(khz), "vertical_beam_width_deg": 180.0},
        water={**scenes.water_of(profile), "absorption_db_per_km": 1e3 * ABSORPTION[khz]},
        film={"range": RANGE, "bins": BINS})
    image = mitsonar.render(scene, seed=seed)
    got = np.mean(10 ** (image["mean_level"].values.astype(float) / 10), axis=(0, 1))
    sonar = sonar_at(scene.sensors()[0], SONAR_DEPTH)
    rays = FlatBed.of(profile, SONAR_DEPTH, BED_DEPTH, RANGE)
    time = image["time"].values
    half = 0.5 * (time[1] - time[0])
    expected = 10 ** (sonar.source_level_db / 10) * sonar.pulse_length / (2 * half) * rays.energy(
        np.append(time - half, time[-1] + half), lambda angle: 10 ** (law(angle) / 10), ABSORPTION[khz],
        rays.beam_azimuths(sonar.along_intensity))
    grazing = rays.grazing_at(time)
    some = (time > 2 * rays.time[0]) & (grazing > FLATTEST) & np.isfinite(expected)
    strength = law(grazing[some])
    return grazing[some], strength + 10 * np.log10(got[some] / expected[some]), strength


def _run(quick):
    pairs, refusals = holding()
    rows, panels = [], []
    for name, levels in EXAMPLE.items():
        got = _example(name, 1_000_000 if quick else 4_000_000)
        rows += [Compared(f"printed example, {name}, {r} m: level", float(one), levels[r], ALLOWED, "dB")
                 for r, one in zip(levels, got)]
    for water, profile in WATERS.items():
        for khz in KHZ:
            lines = []
            for name in SIX:
                if (name, khz) not in pairs or quick and _left_out(water, name, khz):
                    continue

                def law(angle: np.ndarray, name: str = name, khz: float = khz,
                        speed: float = float(profile.at(BED_DEPTH))) -> np.ndarray:
                    return backscatter_strength_db("sediment", angle, 1e3 * khz, sediment=name, sound_speed=speed)

                grazing, got, strength = _strengths(water, khz, scenes.sediment(name), law,
                                                    2_000_000 if quick else 3_000_000, 2, seed=len(rows))
                angles = f"{np.degrees(grazing.max()):.0f} to {np.degrees(grazing.min()):.0f} degrees"
                rows.append(worst(f"{water} water, {khz} kHz, {name}, {angles}", got, strength, ALLOWED, "dB"))
                some = np.unique(np.searchsorted(-grazing, np.linspace(-grazing[0], -grazing[-1], POINTS)))
                lines += [Curve(name, np.degrees(grazing), strength), Curve(name, np.degrees(grazing[some]), got[some],
                                                                          ".")]
            if lines:
                panels.append(Panel(f"{water} water, {khz} kHz", "grazing angle [deg]", "backscatter strength [dB]",
                                    tuple(lines)))
    return Table(tuple(rows), tuple(panels), refusals)


def _left_out(water, name, khz):
    """Return True if the quick run leaves a comparison out.

    It has all sediments at 100 kHz in uniform water, and one sediment at 30 and 300 kHz and in other waters.
    """
    return name != "medium sand" and (water, khz) != ("uniform", 100) or water != "uniform" and khz != 100


CASE = Case(title="Backscatter strength from the levels of a sidescan", run=_run, text=(
    "A flat bed 10 m below a sidescan, omnidirectional in elevation, speckle and noise off: the level of every bin of "
    "0.1 m over the sonar equation integrated over exact eigenrays, ∫ Φ σ(θ) (c_b/c₀)² 10^(-2αL/10)/A² x dx (Jackson "
    "and Richardson 2007), with the law of the sediment, reduced to a strength. Waters: uniform; a summer cast, which "
    "bends rays down, with the thermocline between sonar and bed; winter water, 1.5 1/s, which bends them up. Bins "
    "from the first echo on to a grazing angle of 5 degrees, or to where rays that turned arrive besides. "
    "The first rows are levels of an example that was computed elsewhere by two-dimensional integration. "
    "The allowed error is 0.2 dB in every bin; rays scatter by 0.03 dB rms, by four times that in the worst of a "
    "thousand bins."))
