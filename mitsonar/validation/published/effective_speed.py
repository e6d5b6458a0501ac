"""The linear law of effective speed against height, its coefficient by regression, and where it fails.

    ev(h + Δh) = ev(h) + κ g Δh,    published: κ = 0.503

ev is chord over time of the exact ray from one hit to a receiver Δh above the transmitter, g the gradient dc/dh at the
array. In water of one gradient from the bed to the array

    κ = 1/2 - g h / (6 c)

which is more than a half where sound is faster at the bed: over greatly exaggerated gradients of -1 to -5 1/s and an
array 9.5 m up, 0.503 in the mean. With the signs turned it is 0.497. In any other water

    κ = (c - ev) / (g h)

c the sound speed at the array, so the coefficient says how the array's own water differs from the mean of the column
and has nothing to do with a half: where the array hangs in a layer the law errs by microseconds, more than no
correction at all.
"""
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import xarray as xr

from mitsonar.propagation.numpy_rays.eigenrays import eigenray
from mitsonar.propagation.numpy_rays.paper_approximation import COEFFICIENT
from mitsonar.water.profile import SoundSpeedProfile

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CHANGES = np.linspace(-0.5, 0.5, 21)   # [m]
BED_SPEED = 1500.0                     # [m/s]
HEIGHT, ACROSS = 9.5, 11.4             # [m] array over the bed, and from the hit, of the exaggerated profiles
KINDS = "exaggerated", "reversed", "cast-like"


class Setting(NamedTuple):
    """A profile, the array's height over the hit, its horizontal distance from it [m], and the kind of water."""

    profile: SoundSpeedProfile
    height: float
    across: float
    kind: str


def settings() -> dict[str, Setting]:
    """Return the waters by name: exaggerated ones of one gradient, their reverse, and shapes as casts have them."""
    found = {}
    for kind, sign in zip(KINDS, (-1, 1)):
        for size in (1, 2, 3, 4, 5):
            gradient = sign * size
            profile = SoundSpeedProfile([0, HEIGHT + 1], [BED_SPEED + gradient * (HEIGHT + 1), BED_SPEED])
            found[f"{gradient:+d} 1/s"] = Setting(profile, HEIGHT, ACROSS, kind)
    # made up: fresh water on salt, as in a fjord's mouth; a warm layer over a shelf; a steep layer at the array alone
    estuary = SoundSpeedProfile([0, 1, 2, 3, 4, 6, 8, 11, 15, 20, 30, 45],
                                [1462.1, 1463.0, 1466.4, 1471.2, 1474.9, 1477.6, 1478.3, 1478.9, 1479.2, 1479.7, 1480.6,
                                 1481.5])
    shelf = SoundSpeedProfile([0, 4, 8, 11, 14, 17, 20, 25, 32, 40],
                              [1513.2, 1513.0, 1511.6, 1506.4, 1500.8, 1496.6, 1494.2, 1492.9, 1492.3, 1492.2])
    steep = SoundSpeedProfile([0, 1, 10], [1450, 1455, 1455])
    found["estuary, array at 2.5 m"] = Setting(estuary, 42.5, 50, KINDS[2])
    found["estuary, array at 13 m"] = Setting(estuary, 32, 40, KINDS[2])
    found["summer, array in the thermocline"] = Setting(shelf, 27.5, 33, KINDS[2])
    found["summer, array below it"] = Setting(shelf, 11.5, 14, KINDS[2])
    found["-5 1/s in the upper metre alone"] = Setting(steep, HEIGHT, ACROSS, KINDS[2])
    return found


def compute() -> xr.Dataset:
    """Compute effective speeds against height, and the coefficients."""
    waters = settings()
    found = [_one(setting) for setting in waters.values()]
    kinds = np.array([setting.kind for setting in waters.values()])
    units = {"effective_speed": "m/s", "gradient": "1/s", "coefficient": "1", "expected": "1", "curvature": "m/s",
             "law_error": "s", "no_correction_error": "s"}
    data = {name: (("water", "height_change") if name == "effective_speed" else "water",
                   np.array([one[name] for one in found]), {"units": unit}) for name, unit in units.items()}
    return xr.Dataset({**data, "kind": ("water", kinds)},
                      coords={"water": list(waters), "height_change": ("height_change", CHANGES, {"units": "m"})},
                      attrs={"mean_coefficient": float(data["coefficient"][1][kinds == KINDS[0]].mean())})


def _one(setting):
    """Everything about one water."""
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
        expected = 0.5 - gradient * setting.height / (3 * (local[here] + BED_SPEED))
    law = speed[here] + COEFFICIENT * (local - local[here])
    return {"effective_speed": speed, "gradient": gradient, "coefficient": slope / gradient, "expected": expected,
            "curvature": np.abs(speed - start - slope * CHANGES).max(),
            "law_error": np.abs(distance / law - time).max(),
            "no_correction_error": np.abs(distance / speed[here] - time).max()}


def table(dataset: xr.Dataset) -> str:
    """Say the coefficients in text."""
    lines = [f"{'':36}gradient  coefficient           off the line   largest error of the time [ns]",
             f"{'water':36}{'[1/s]':>8}{'fitted':>9}{'expected':>10}{'[m/s]':>13}{'law':>14}{'no correction':>17}"]
    for name in dataset.water.values:
        one = {key: float(value) for key, value in dataset.sel(water=name).drop_vars(
            ("effective_speed", "kind", "water", "height_change")).items()}
        lines.append(f"{name:36}{one['gradient']:8.3f}{one['coefficient']:9.4f}{one['expected']:10.4f}"
                     f"{one['curvature']:13.4f}{1e9 * one['law_error']:14.1f}{1e9 * one['no_correction_error']:17.1f}")
    return "\n".join([*lines, f"mean coefficient of the exaggerated waters, faster at the bed: "
                              f"{dataset.mean_coefficient:.4f}; published: {COEFFICIENT}"])


def rows(dataset: xr.Dataset) -> tuple[list[str], list[tuple]]:
    """Header and records of the figure as a table: one height a line."""
    records = [(str(name), f"{change:.3f}", f"{float(speed):.9f}", f"{float(one.coefficient):.6f}")
               for name, one in ((name, dataset.sel(water=name)) for name in dataset.water.values)
               for change, speed in zip(dataset.height_change.values, one.effective_speed.values)]
    return ["water", "height_change_m", "effective_speed_m_s", "coefficient"], records


def plot(dataset: xr.Dataset) -> "Figure":
    """Draw the change of effective speed against the change the gradient makes at the array."""
    from mitsonar.plots import canvas

    figure = canvas.sheet(1300, 560)
    still = int(np.argmin(np.abs(dataset.height_change.values)))
    titles = "one gradient: the law holds", "shaped like casts: it does not"
    for axes, kinds, title in zip(figure.subplots(1, 2), (KINDS[:2], KINDS[2:]), titles):
        for name in dataset.water.values[np.isin(dataset.kind.values, kinds)]:
            one = dataset.sel(water=name)
            axes.plot(float(one.gradient) * one.height_change,
                      one.effective_speed - one.effective_speed[still], linewidth=1.4,
                      label=f"{name}: {float(one.coefficient):.4f}")
        reach = np.array(axes.get_xlim())
        axes.plot(reach, COEFFICIENT * reach, color="black", linestyle=":", label=f"law: {COEFFICIENT}")
        axes.set(xlabel="gradient times change of height [m/s]", ylabel="change of effective speed [m/s]", title=title)
        axes.legend(fontsize=8)
        axes.grid(alpha=0.25)
    figure.suptitle("Effective speed against height: coefficient by regression", fontsize=14, fontweight="bold")
    figure.tight_layout()
    return figure
