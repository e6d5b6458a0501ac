"""Published table and coefficient of the method, computed again; scenes/published prints and draws them.

Table 1: effective speed and return time of one ray, traced and by equation 2.

    ev_r = ev_i + 0.503 g (h_r - h_i),    t_r = |F - I| / ev_r

The publication has the heights of transmission 9.5 m and reception 9.382419 m over the bed, the horizontal range
11.494591 m of the reception, a gradient of -5 1/s, two effective speeds and two times, but not the profile. Water of
constant gradient dc/dh = -5 1/s reproduces both columns if its speed at the bed is 1499.346571 m/s, by

    cosh(g t) = 1 + g² D² / (2 c_I c_F)

The hit then lies 11.369819 m from the transmission: the receiver is 0.125 m behind and 0.118 m below it, on a face
tilted by 47 degrees, published as "around 40". The second time is printed as ...573 in the available copy; its speed
and the published difference of 23 ns, 1/87 of a period at 500 kHz, give ...578.

Law of effective speed against height, its coefficient by regression, and its limits:

    ev(h + Δh) = ev(h) + κ g Δh,    published: κ = 0.503

ev is chord over time of the exact ray from one hit to a receiver Δh above the transmitter, g the gradient dc/dh at the
array. In water of one gradient from the bed to the array

    κ = 1/2 - g h / (6 c)

which exceeds 1/2 if sound is faster at the bed: its mean is 0.503 over strongly exaggerated gradients of -1 to -5 1/s
and an array 9.5 m up, and 0.497 with the opposite sign. In any other water

    κ = (c - ev) / (g h)

with c the sound speed at the array. The coefficient then depends on the difference between the water at the array and
the mean of the column, and is far from 1/2. For an array within a layer the law errs by microseconds, more than without
any correction.
"""
from typing import Literal, NamedTuple

import numpy as np
import xarray as xr

from mitsonar.propagation.numpy_rays.eigenrays import eigenray
from mitsonar.propagation.numpy_rays.paper_approximation import COEFFICIENT
from mitsonar.propagation.numpy_rays.return_times import return_time
from mitsonar.water.profile import SoundSpeedProfile

HEIGHTS = 9.5, 9.382419            # [m] of transmission and reception
RANGE = 11.494591                  # [m] of the reception
GRADIENT = -5.0                    # [1/s] dc/dh
BED_SPEED = 1499.346570536         # [m/s]
INCIDENT_RANGE = 11.36981948       # [m] of the transmission
FREQUENCY = 500e3                  # [Hz]
WATER_DEPTH = 10.0                 # [m]; the water above the sonar has no effect
METHODS: dict[str, Literal["eigenray", "paper", "vector"]] = {
    "traced": "eigenray", "equation 2": "paper", "vector approximation": "vector"}
PRINTED_SPEED = 1475.859495, 1475.856104, np.nan
PRINTED_TIME = 0.010053555, 0.010053578, np.nan

CHANGES = np.linspace(-0.5, 0.5, 21)   # [m]
FIXED_SPEED = 1500.0                   # [m/s] at the bed
HEIGHT, ACROSS = 9.5, 11.4             # [m] array over the bed, and from the hit, of the exaggerated profiles
KINDS = "exaggerated", "reversed", "cast-like"


def table_1() -> xr.Dataset:
    """Return Table 1: effective speeds and times by each method, with the printed numbers."""
    water = SoundSpeedProfile([0, WATER_DEPTH], [BED_SPEED + GRADIENT * WATER_DEPTH, BED_SPEED])
    origin = np.array([0, 0, HEIGHTS[0] - WATER_DEPTH])
    hit, element = [INCIDENT_RANGE, 0, -WATER_DEPTH], [INCIDENT_RANGE - RANGE, 0, HEIGHTS[1] - HEIGHTS[0]]
    times = np.array([return_time(water, origin, [hit], [element], method=method)[0, 0]
                      for method in METHODS.values()])
    incident = return_time(water, origin, [hit], [[0, 0, 0]], method="eigenray")[0, 0]
    height = np.linspace(0, WATER_DEPTH, 11)
    speed = {"units": "m/s"}
    return xr.Dataset(
        {"effective_speed": ("found_by", np.hypot(RANGE, HEIGHTS[1]) / times, speed),
         "return_time": ("found_by", times, {"units": "s"}),
         "printed_speed": ("found_by", np.array(PRINTED_SPEED), speed),
         "printed_time": ("found_by", np.array(PRINTED_TIME), {"units": "s"}),
         "sound_speed": ("height", water.at(WATER_DEPTH - height), speed)},
        coords={"found_by": list(METHODS), "height": ("height", height, {"units": "m"})},
        attrs={"incident_speed": float(np.hypot(INCIDENT_RANGE, HEIGHTS[0]) / incident), "frequency": FREQUENCY,
               "displacement": float(np.hypot(RANGE, HEIGHTS[1]))})


class _Setting(NamedTuple):
    """A profile, the array's height over the hit, its horizontal distance from it [m], and the kind of water."""

    profile: SoundSpeedProfile
    height: float
    across: float
    kind: str


def _settings() -> dict[str, _Setting]:
    """Return the waters by name: exaggerated gradients, reversed ones, and shapes like those of casts."""
    found = {}
    for kind, sign in zip(KINDS, (-1, 1)):
        for size in (1, 2, 3, 4, 5):
            gradient = sign * size
            profile = SoundSpeedProfile([0, HEIGHT + 1], [FIXED_SPEED + gradient * (HEIGHT + 1), FIXED_SPEED])
            found[f"{gradient:+d} 1/s"] = _Setting(profile, HEIGHT, ACROSS, kind)
    # invented: fresh water above salt water, as at the mouth of a fjord; a warm layer over a shelf; a steep top layer
    estuary = SoundSpeedProfile([0, 1, 2, 3, 4, 6, 8, 11, 15, 20, 30, 45],
                                [1462.1, 1463.0, 1466.4, 1471.2, 1474.9, 1477.6, 1478.3, 1478.9, 1479.2, 1479.7, 1480.6,
                                 1481.5])
    shelf = SoundSpeedProfile([0, 4, 8, 11, 14, 17, 20, 25, 32, 40],
                              [1513.2, 1513.0, 1511.6, 1506.4, 1500.8, 1496.6, 1494.2, 1492.9, 1492.3, 1492.2])
    steep = SoundSpeedProfile([0, 1, 10], [1450, 1455, 1455])
    found["estuary, array at 2.5 m"] = _Setting(estuary, 42.5, 50, KINDS[2])
    found["estuary, array at 13 m"] = _Setting(estuary, 32, 40, KINDS[2])
    found["summer, array in the thermocline"] = _Setting(shelf, 27.5, 33, KINDS[2])
    found["summer, array below it"] = _Setting(shelf, 11.5, 14, KINDS[2])
    found["-5 1/s in the upper metre alone"] = _Setting(steep, HEIGHT, ACROSS, KINDS[2])
    return found


def effective_speed() -> xr.Dataset:
    """Return effective speeds against height, and the coefficients."""
    waters = _settings()
    results = [_results(setting) for setting in waters.values()]
    kinds = np.array([setting.kind for setting in waters.values()])
    units = {"effective_speed": "m/s", "gradient": "1/s", "coefficient": "1", "expected": "1", "curvature": "m/s",
             "law_error": "s", "no_correction_error": "s"}
    data = {name: (("water", "height_change") if name == "effective_speed" else "water",
                   np.array([result[name] for result in results]), {"units": unit}) for name, unit in units.items()}
    return xr.Dataset({**data, "kind": ("water", kinds)},
                      coords={"water": list(waters), "height_change": ("height_change", CHANGES, {"units": "m"})},
                      attrs={"mean_coefficient": float(data["coefficient"][1][kinds == KINDS[0]].mean())})


def _results(setting: _Setting) -> dict[str, object]:
    """Return the results for one water."""
    bed = setting.profile.depth[-1]
    depth = bed - setting.height
    time = eigenray(setting.profile, depth - CHANGES, bed, setting.across).travel_time
    distance = np.hypot(setting.across, setting.height + CHANGES)
    speed = distance / time
    here = np.argmin(np.abs(CHANGES))
    local = setting.profile.at(depth - CHANGES)
    gradient = (local[-1] - local[0]) / (CHANGES[-1] - CHANGES[0])
    slope, start = np.polyfit(CHANGES, speed, 1)
    if setting.kind == KINDS[2]:
        expected = (local[here] - speed[here]) / (gradient * setting.height)
    else:
        expected = 0.5 - gradient * setting.height / (3 * (local[here] + FIXED_SPEED))
    law = speed[here] + COEFFICIENT * (local - local[here])
    return {"effective_speed": speed, "gradient": gradient, "coefficient": slope / gradient, "expected": expected,
            "curvature": np.abs(speed - start - slope * CHANGES).max(),
            "law_error": np.abs(distance / law - time).max(),
            "no_correction_error": np.abs(distance / speed[here] - time).max()}
