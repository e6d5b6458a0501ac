"""Soundings of lines over a slope, simulated for inversions: another bed and another water than a fit can have.

The bed is a slope with relief on a grid of a metre or two, where a fit has nodes many metres apart; the water is a cast
as it was measured, sample by sample; positions are off by some centimetres a ping; times are noisy.
"""
from dataclasses import replace

import numpy as np

HEAD = 1.5                             # [m] depth of the arrays
SLOPE = 0.1
WIDEST = 60                            # [deg] from the vertical
STEEP = np.radians(WIDEST)


def surveyed(cast, shallowest, deepest, *, noise=10e-6, navigation=0.05, roughness=0.03, seed=0, lines=5, pings=60,
             beams=48, crossing=3):
    """Simulate lines up the slope and some across it; give SoundingBeams and the true bed as a BedGrid."""
    from mitsonar.gradients.soundings.sounding_times import SoundingTimes
    from mitsonar.hydrography.detection.sounding_beams import SoundingBeams

    rng = np.random.default_rng(seed)
    length = max(deepest - shallowest, 0.2 * deepest) / (SLOPE if deepest > 1.2 * shallowest else 0.2)
    bed = rough_slope(rng, length, shallowest, deepest, roughness)
    spacing = 0.5 * (shallowest + deepest)
    tracks = [(np.linspace(0.05, 0.95, pings) * length, np.full(pings, (k - (lines - 1) / 2) * spacing), 0.0)
              for k in range(lines)]
    side = lines * spacing / 2
    tracks += [(np.full(pings, share * length), np.linspace(-side, side, pings), np.pi / 2)
               for share in np.linspace(0.15, 0.85, crossing)]
    angle = np.linspace(-STEEP, STEEP, beams)
    rows = []
    for x, y, course in tracks:                                          # course from the x axis towards y
        aside = np.sign(angle) * np.ones((len(x), 1))
        rows.append([np.repeat(x, beams), np.repeat(y, beams), (aside * np.sin(course)).ravel(),
                     (-aside * np.cos(course)).ravel(), np.tile(np.abs(angle), len(x)), aside.ravel()])
    x, y, east, north, steep, starboard = np.concatenate(rows, axis=1)
    head = float(cast.at(HEAD))
    ones = np.ones(len(x))
    true = SoundingBeams(x=x, y=y, depth=HEAD * ones, east=east, north=north, slowness=np.sin(steep) / head,
                         travel_time=ones, head_speed=(head + 0.1) * ones, starboard=starboard)
    time = SoundingTimes(true, cast, bed).value({})
    astray = np.repeat(navigation * rng.standard_normal((2, len(x) // beams)), beams, axis=1)
    return replace(true, x=x + astray[0], y=y + astray[1],
                   travel_time=time + noise * rng.standard_normal(len(x))), bed


def rough_slope(rng, length, shallowest, deepest, roughness):
    """Make a bed that falls along x, with hills of a twentieth of the depth and small relief."""
    from mitsonar.gradients.soundings.sounding_bed import BedGrid

    side, step = 4 * deepest + 40, max(1.0, length / 600)
    x, y = np.arange(-2 * deepest, length + 2 * deepest, step), np.arange(-side, side, step)
    fall = shallowest + (deepest - shallowest) * np.clip(x / length, 0, 1)
    wave = np.hypot(*np.meshgrid(np.fft.fftfreq(x.size, step), np.fft.fftfreq(y.size, step)))
    relief = []
    for size, height in ((60 * step, 0.02 * shallowest), (8 * step, roughness)):
        grain = np.fft.ifft2(np.fft.fft2(rng.standard_normal((y.size, x.size))) * np.exp(-(wave * size) ** 2)).real
        relief.append(height * grain / grain.std())
    return BedGrid(x=x, y=y, depth=fall + relief[0] + relief[1])
