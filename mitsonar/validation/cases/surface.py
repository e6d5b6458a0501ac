"""Sea surface: printed strengths and losses, and its echo in a sidescan's image."""
import numpy as np

from mitsonar.scattering.laws.sea_surface import bubble_loss_db
from mitsonar.scattering.laws.strength import backscatter_strength_db

from .. import scenes
from ..case import Case, Compared, Curve, Panel, Table, worst
from ..sonar_equation import FlatBed
from .closure import WATERS

LOSSES = {  # wind [m/s], kHz, grazing [deg] -> dB, TR 9407 part II
    (5, 20, 10): 0.464644, (10, 20, 10): 3.440138, (15, 20, 10): 6.501882, (3, 100, 30): 0.057496,
    (10, 100, 30): 4.692460, (12, 50, 20): 5.067082}
DEGREES = (10, 30, 60, 90)
STRENGTHS = {  # kHz, wind [m/s] -> dB at DEGREES
    (30, 6): (-34.7746, -34.5454, -30.0835, 5.6406), (30, 10): (-27.9341, -20.9624, -18.5694, 4.2784),
    (100, 6): (-32.4501, -32.0294, -29.3389, 4.9670), (100, 10): (-30.9968, -24.9700, -20.6375, 2.7749),
    (100, 15): (-31.0024, -26.4040, -23.4696, 0.0707)}
SONAR_DEPTH, RANGE, BINS, KHZ = 12.0, 80.0, 320, 100       # [m], [m]
ABSORPTION, FLATTEST = 0.0334, np.radians(9.0)     # [dB/m], [rad]
WINDS = (6.0, 12.0)                                # [m/s]


def _printed():
    got = [float(bubble_loss_db(np.radians(angle), 1e3 * khz, wind)) for wind, khz, angle in LOSSES]
    yield worst("bubble loss of a bounce", got, list(LOSSES.values()), 1e-6, "dB")
    for (khz, wind), strengths in STRENGTHS.items():
        got = backscatter_strength_db("sea_surface", np.radians(DEGREES), 1e3 * khz, wind_speed=float(wind))
        yield worst(f"strength of the surface, {khz} kHz, wind {wind} m/s", got, strengths, 6e-5, "dB")


def _return(water, wind, rays):
    """Return the comparison of the surface's echo with its law.

    The answer is grazing angles [rad], strengths [dB] from the bins and by the law, the centres [s] of the first bin
    with an echo and of the bin of the shortest path, and half a bin [s].
    """
    import mitsonar
    from mitsonar.survey.sidescan.kind import sonar_at

    profile = WATERS[water]
    scene = scenes.sidescan(
        {"bed": scenes.buried_bed(300.0, size=900.0), "sea": {"type": "sea_surface", "wind_speed": wind}},
        depth=SONAR_DEPTH, rays=rays, pings=4,
        sensor={"frequency_khz": float(KHZ), "vertical_beam_width_deg": 180.0},
        water={**scenes.water_of(profile), "absorption_db_per_km": 1e3 * ABSORPTION},
        film={"range": RANGE, "bins": BINS})
    image = mitsonar.render(scene, seed=2)
    got = np.mean(10 ** (image["mean_level"].values.astype(float) / 10), axis=(0, 1))
    sonar, time = sonar_at(scene.sensors()[0], SONAR_DEPTH), image["time"].values
    half = 0.5 * (time[1] - time[0])
    plane = FlatBed.of(profile, SONAR_DEPTH, 0.0, RANGE)

    def law(angle: np.ndarray) -> np.ndarray:
        return backscatter_strength_db("sea_surface", angle, 1e3 * KHZ, wind_speed=wind,
                                       sound_speed=float(profile.at(0.0)))

    expected = 10 ** (sonar.source_level_db / 10) * sonar.pulse_length / (2 * half) * plane.energy(
        np.append(time - half, time[-1] + half), lambda angle: 10 ** (law(angle) / 10), ABSORPTION,
        plane.beam_azimuths(sonar.along_intensity))
    grazing = plane.grazing_at(time)
    some = (time > 2 * plane.time[0]) & (grazing > FLATTEST) & np.isfinite(expected)
    strength = law(grazing[some])
    first = float(time[np.flatnonzero(got > 1e-6 * got.max())[0]])
    nearest = float(time[np.searchsorted(time + half, 2 * plane.time[0] + 1e-9)])
    return grazing[some], strength + 10 * np.log10(got[some] / expected[some]), strength, first, nearest, half


def _run(quick):
    rows, lines = list(_printed()), []
    for water in ("uniform",) if quick else ("uniform", "summer", "winter"):
        for wind in WINDS[:1] if quick else WINDS:
            grazing, got, strength, first, nearest, half = _return(water, wind, 1_000_000 if quick else 3_000_000)
            name = f"{water} water, wind {wind:g} m/s"
            angles = f"{np.degrees(grazing.max()):.0f} to {np.degrees(grazing.min()):.0f} degrees"
            rows += [Compared(f"{name}: bin of the first return", 1e3 * first, 1e3 * nearest, 1e3 * half, "ms"),
                     worst(f"{name}: strength, {angles}", got, strength, 0.2, "dB")]
            some = np.unique(np.searchsorted(-grazing, np.linspace(-grazing[0], -grazing[-1], 60)))
            lines += [Curve(name, np.degrees(grazing), strength), Curve(name, np.degrees(grazing[some]), got[some],
                                                                        ".")]
    angle = np.radians(np.linspace(2, 90, 300))
    laws = [line for (khz, wind), strengths in STRENGTHS.items() for line in (
        Curve(f"{khz} kHz, {wind} m/s", np.degrees(angle), backscatter_strength_db(
            "sea_surface", angle, 1e3 * khz, wind_speed=float(wind))),
        Curve(f"{khz} kHz, {wind} m/s", DEGREES, strengths, "."))]
    return Table(tuple(rows), (
        Panel("law", "grazing angle [deg]", "strength [dB]", tuple(laws)),
        Panel(f"read back from a sidescan, {KHZ} kHz", "grazing angle [deg]", "strength [dB]", tuple(lines))))


CASE = Case(title="Sea surface: loss, strength, return", run=_run, text=(
    "Loss to bubbles and backscatter strength of APL-UW TR 9407, part II, against printed numbers; then the surface "
    "12 m above a sidescan, omnidirectional in elevation: the first bin with an echo, of 0.25 m, and the "
    "level of every bin down to 9 degrees over the sonar equation integrated over exact eigenrays to the surface, "
    "reduced to a strength. The allowed errors are the printed digits, and 0.2 dB in every bin."))
