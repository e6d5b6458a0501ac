"""Volume reverberation of a sidescan against the sonar equation, for uniform water and for a layer."""
import numpy as np

from mitsonar.water.volume import volume_reverberation_db

from .. import scenes
from ..case import Case, Compared, Curve, Panel, Table, worst

SONAR_DEPTH, BED_DEPTH, SPEED, ABSORPTION = 150.0, 600.0, 1500.0, 0.0334        # [m], [m], [m/s], [dB/m]
STRENGTH_DB, LAYER, LAYER_DB = -80.0, (165.0, 172.0), -65.0                     # [dB re 1/m], depths [m]
RANGE, BINS = 100.0, 400
PRINTED = {"source_level_db": 220.0, "slant_range": 100.0, "volume_strength_db": -80.0, "beam_solid_angle": 0.01,
           "pulse_length": 1e-4, "absorption_db": 0.03339952697}, 62.070707240
ALLOWED = 0.2                                      # [dB]


def _levels(water, rays, pings):
    """Return slant ranges [m] and mean levels [dB] of the bins, the sonar, and the width of a bin [m]."""
    import mitsonar
    from mitsonar.survey.sidescan.kind import sonar_at

    scene = scenes.sidescan({"bed": scenes.buried_bed(BED_DEPTH, size=2500.0)}, depth=SONAR_DEPTH, rays=rays,
                            pings=pings, film={"range": RANGE, "range_min": 5.0, "bins": BINS},
                            water={"sound_speed": SPEED, "absorption_db_per_km": 1e3 * ABSORPTION, **water})
    image = mitsonar.render(scene, seed=3)
    level = 10 * np.log10(np.mean(10 ** (image["mean_level"].values.astype(float) / 10), axis=(0, 1)))
    return image["range"].values, level, sonar_at(scene.sensors()[0], SONAR_DEPTH), image.attrs["bin_width"]


def _layered(sonar, slant_range, width):
    """Return the levels [dB] of a layer by the sonar equation, integrated over directions and over each bin."""
    u = np.sinh(np.linspace(-9, 9, 1201)) / np.sinh(9)
    phi = np.linspace(-np.pi / 2, np.pi / 2, 6001)
    across = np.sqrt(1 - u * u)[:, None]
    pattern = sonar.along_intensity(u)[:, None] * sonar.across_intensity(
        across * np.sin(phi - sonar.depression_angle))
    # the beam's share of directions with sin < d, d depth per metre of range: Ψ(d) = ∫ B [sin < d] dΩ, by a histogram
    solid = pattern * np.gradient(u)[:, None] * (phi[1] - phi[0])
    edges = np.linspace(-1, 1, 4001)
    share = np.append(0, np.cumsum(np.histogram(across * np.sin(phi), edges, weights=solid)[0]))
    r = slant_range[:, None] + width * (np.arange(9) - 4) / 9
    within = np.diff([np.interp((depth - SONAR_DEPTH) / r, edges, share) for depth in LAYER], axis=0)[0]
    found = np.mean(within * r ** -2.0 * 10 ** (-0.2 * ABSORPTION * r), axis=1)
    with np.errstate(divide="ignore"):
        return (sonar.source_level_db + LAYER_DB + 10 * np.log10(0.5 * SPEED * sonar.pulse_length)
                + 10 * np.log10(found))


def _run(quick):
    asked, level = PRINTED
    rows = [Compared("printed example", float(volume_reverberation_db(**asked, sound_speed=SPEED)), level, 1e-6, "dB")]
    rays, pings = (800_000, 60) if quick else (1_600_000, 200)
    r, got, sonar, width = _levels({"volume_strength_db": STRENGTH_DB}, rays, pings)
    expected = (sonar.source_level_db - 20 * np.log10(r) - 2 * ABSORPTION * r + STRENGTH_DB
                + 10 * np.log10(sonar.solid_angle() * 0.5 * SPEED * sonar.pulse_length))
    rows += [worst("uniform water: level", got, expected, ALLOWED, "dB"),
             Compared("uniform water: mean over bins", float(np.mean(got - expected)), 0.0, 0.02, "dB")]
    panels = [Panel("-80 dB everywhere", "slant range [m]", "dB re 1 µPa", (Curve("closed form", r, expected),
                                                                          Curve("chain", r, got, ".")))]
    r, got, sonar, width = _levels({"layers": f"bubbles {LAYER[0]} {LAYER[1]} {LAYER_DB}"}, rays, pings)
    some = np.flatnonzero(r > 1.3 * (LAYER[0] - SONAR_DEPTH))
    expected = _layered(sonar, r[some], width)
    rows += [worst("layer: level", got[some], expected, ALLOWED, "dB"),
             Compared("layer: mean over bins", float(np.mean(got[some] - expected)), 0.0, 0.03, "dB")]
    panels.append(Panel(f"{LAYER_DB:g} dB from {LAYER[0]:g} to {LAYER[1]:g} m, sonar at {SONAR_DEPTH:g} m",
                        "slant range [m]", "dB re 1 µPa",
                        (Curve("integral", r[some], expected), Curve("chain", r[some], got[some], "."))))
    return Table(tuple(rows), tuple(panels))


CASE = Case(title="Volume reverberation", run=_run, text=(
    "A sidescan in the middle of deep water: level of every bin against SL - 20 log R - 2αR + S_v + 10 log(ψcτ/2) "
    "(Urick 1983), ψ = ∫ b_t² b_r² dΩ of a face; and of a layer below the sonar against the same equation integrated "
    "over directions, ∫ b_t² b_r² s_v(z + R sin) dΩ. The allowed error is 0.2 dB in every bin, and less in the mean "
    "over bins, because the scatter of rays averages out."))
