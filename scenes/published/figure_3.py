"""Figure 3 of the published method: three rays on a flat bed, received by arrays of one and of three elements.

    t = T(transmitter -> hit) + T_r(hit -> receiver)

T is traced, T_r the vector approximation (`propagation.return_time`), the platform moving on meanwhile. Three transmit
elements send three rays each, three receive elements hear them: 3 impulses become 27.

As published, every transmit element sends its own fan at the same launch angles, so that each finds hits of its own:
what shifts the impulses between transmit elements is above all that the hits are others. With common scatterers, lit
from the array's centre, transmit and receive elements shift them alike. Nearest to a plane wave, the shifts of a ray
α off the array's axis between neighbours d apart up the tilted plane, grazing angle θ = 45° - α, are

    reception, and transmission to common scatterers     d sin α / c
    transmission, each element with hits of its own      (Δz / sin θ + (Δz / tan θ + Δz) cos θ) / c,  Δz = d / √2
"""
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from mitsonar.propagation.numpy_rays.return_times import return_time

from .bundles import send, shipped_survey

if TYPE_CHECKING:
    from matplotlib.figure import Figure


__all__ = ["ARRANGEMENTS", "ELEMENTS", "compute", "plot", "rows", "table"]

SCENE = "published_figure_3"
LAUNCH_ANGLES = np.radians([67.0, 45.0, 23.0])          # below the horizontal: times rise
ELEMENTS = 3
UP_THE_PLANE, FORWARD = "0, 1, -1", "forward"
# scene's axis, how many elements, whether each transmit element sends rays of its own
ARRANGEMENTS = {
    "one element": (UP_THE_PLANE, 1, True),
    "3 vertically": (UP_THE_PLANE, 3, True),
    "3 horizontally": (FORWARD, 3, True),
    "3 vertically, common scatterers": (UP_THE_PLANE, 3, False),
}
PUBLISHED_TRANSMIT, PUBLISHED_RECEIVE = 260, 20         # [samples], at a sampling rate that is not stated
SHOWN = 2                                               # the ray whose impulses are drawn from near by


def compute(**parameters: object) -> xr.Dataset:
    """Compute every impulse of every arrangement.

    Parameters
    ----------
    **parameters
        Values for the ``$parameters`` of the scene published_figure_3 other than elements and axis.

    Returns
    -------
    xarray.Dataset
        ``delay`` [s] and ``intensity`` (re the strongest of one element) over (arrangement, ray, tx, rx), NaN where an
        arrangement has no such element; ``exact_delay``, with eigenrays in the place of the vector approximation, and
        ``uniform_delay``, in water that has everywhere the sound speed at the sonar. ``transmit_shift``,
        ``receive_shift`` [s] (arrangement, ray): mean size of the change of delay from one transmit (receive) element
        to its neighbour, the other one kept; ``uniform_...`` of these. ``launch_angle`` [rad] (ray).

    Raises
    ------
    ValueError, TypeError
        If a parameter is none of the scene's or has a value it cannot take.
    """
    for name in ("elements", "axis"):
        if name in parameters:
            raise ValueError(f"figure_3 sets {name} itself, one value for each arrangement; leave it out")
    shape = (len(ARRANGEMENTS), len(LAUNCH_ANGLES), ELEMENTS, ELEMENTS)
    results = {name: np.full(shape, np.nan) for name in ("delay", "exact_delay", "uniform_delay", "intensity")}
    for row, (axis, elements, own_rays) in enumerate(ARRANGEMENTS.values()):
        survey = shipped_survey(SCENE, **parameters, axis=axis, elements=elements)
        used = np.s_[row, :, :elements, :elements]
        impulses = _Impulses(survey, own_rays)
        results["delay"][used], results["intensity"][used] = impulses.delay("vector"), impulses.intensity
        results["exact_delay"][used] = impulses.delay("eigenray")
        uniform = {**parameters, "profile": f"0: {survey.planned_speed!r}"}
        uniform = shipped_survey(SCENE, **uniform, axis=axis, elements=elements)
        results["uniform_delay"][used] = _Impulses(uniform, own_rays).delay("vector")
    results["intensity"] /= np.nanmax(results["intensity"][0])
    dims = ("arrangement", "ray", "tx", "rx")
    data: dict[str, Any] = {name: (dims, values, {"units": "1" if name == "intensity" else "s"})
                            for name, values in results.items()}
    for prefix, name in (("", "delay"), ("uniform_", "uniform_delay")):
        for side, axis in (("transmit", 2), ("receive", 3)):
            data[f"{prefix}{side}_shift"] = (dims[:2], _shift(results[name], axis), {"units": "s"})
    return xr.Dataset(data, coords={"arrangement": list(ARRANGEMENTS),
                                    "launch_angle": ("ray", LAUNCH_ANGLES, {"units": "rad"})},
                      attrs={"sampling_rate": survey.sampling_rate, "sound_speed": survey.planned_speed,
                             "speed": float(np.linalg.norm(survey.velocity[0])), "scene": SCENE})


class _Impulses:
    """The impulses of an array whose transmit elements send their own rays, or light hits common to all."""

    def __init__(self, survey, own_rays):
        self.survey = survey
        self.rotation, self.centre = survey.track.rotation()[0], survey.track.position[0]
        transmit = survey.transmit.position
        sources = transmit if own_rays else np.zeros((1, 3))
        rays = len(LAUNCH_ANGLES)
        bundle = send(survey, np.repeat(sources, rays, 0), np.tile(LAUNCH_ANGLES, len(sources)))
        if not np.isfinite(bundle.travel_time).all():
            raise ValueError("figure_3: a ray missed the bed; give water that lets all three reach it")

        def each(values):
            """(source, ray, ...) for every transmit element."""
            return np.broadcast_to(values.reshape(len(sources), rays, *values.shape[1:]),
                                   (len(transmit), rays, *values.shape[1:]))

        self.hits = each(bundle.point)
        self.intensity = np.repeat(each(bundle.intensity).T[..., None], survey.receive.elements, -1)
        self.outward = each(bundle.travel_time)
        if not own_rays:
            # by reciprocity: the way from a transmit element to the common hit is the way back to it
            self.outward = return_time(survey.waters.only.profile, self.centre, bundle.point,
                                       transmit @ self.rotation.T).T

    def delay(self, method):
        """(ray, tx, rx) [s], the way back found by a method of `return_time`."""
        survey, delay = self.survey, []
        for position, hits, outward in zip(survey.transmit.position, self.hits, self.outward):
            offset = (survey.receive.position - position) @ self.rotation.T
            back = return_time(survey.waters.only.profile, self.centre + self.rotation @ position, hits, offset,
                               survey.velocity[0], method)
            delay.append(outward[:, None] + back)
        return np.stack(delay, 1)


def _shift(delay, axis):
    """Mean size of the step from one element to the next, (arrangement, ray); NaN of a single element."""
    steps = np.abs(np.diff(delay, axis=axis))
    several = np.isfinite(steps).any((2, 3))
    return np.where(several, np.nansum(steps, (2, 3)) / np.maximum(np.isfinite(steps).sum((2, 3)), 1), np.nan)


def _samples(dataset):
    """Nearest sample of every impulse (arrangement, ray, tx, rx), NaN where there is none."""
    return np.round(dataset.delay.values * dataset.sampling_rate)


def _apart(samples):
    """How many impulses lie in another sample than most of their group (tx, rx)."""
    _, counts = np.unique(samples[np.isfinite(samples)], return_counts=True)
    return int(counts.sum() - counts.max())


def table(dataset: xr.Dataset) -> str:
    """Say in words and numbers what the figure shows."""
    rate = dataset.sampling_rate
    lines = [f"sampling rate {rate / 1e6:g} MHz, elements 100 mm apart, platform at {dataset.speed:.2f} m/s",
             f"{'':36}impulses   ray    shift to the next element [us = samples at 1 MHz]      not in the",
             f"{'arrangement':36}{'':11}[deg]  transmit (uniform water)  receive (uniform water)  group's sample"]
    samples = _samples(dataset)
    for row, name in enumerate(dataset.arrangement.values):
        one = dataset.isel(arrangement=row)
        for ray in range(dataset.sizes["ray"]):
            shifts = [1e6 * float(one[key][ray]) for key in
                      ("transmit_shift", "uniform_transmit_shift", "receive_shift", "uniform_receive_shift")]
            shown = ("{:14.2f} ({:.2f}){:15.2f} ({:.2f})".format(*shifts) if np.isfinite(shifts[0]) else "").ljust(48)
            first = f"{name:36}{int(one.delay.notnull().sum()):8}" if not ray else " " * 44
            lines.append(f"{first}{np.degrees(float(dataset.launch_angle[ray])):8.0f}{shown}"
                         f"{_apart(samples[row, ray]):6} of {int(np.isfinite(samples[row, ray]).sum())}")
    vertical = dataset.sel(arrangement="3 vertically").isel(ray=SHOWN)
    transmit, receive = float(vertical.transmit_shift), float(vertical.receive_shift)
    uniform = float(vertical.uniform_transmit_shift)
    error = 1e9 * float(abs(dataset.delay - dataset.exact_delay).max())
    lines += [
        "", f"published: about {PUBLISHED_TRANSMIT} and {PUBLISHED_RECEIVE} samples between vertical elements, at a "
        f"rate it does not state: {PUBLISHED_TRANSMIT / transmit / 1e6:.2f} MHz would make",
        f"our {1e6 * transmit:.1f} us the one, {PUBLISHED_RECEIVE / receive / 1e6:.2f} MHz our {1e6 * receive:.1f} us "
        "the other. The larger shift is that of the hits: each transmit element",
        f"finds its own, and water of one speed shifts them by {1e6 * uniform:.1f} us. Common scatterers have no such "
        "shift.",
        f"vector approximation against eigenrays: {error:.2g} ns at most"]
    return "\n".join(lines)


def rows(dataset: xr.Dataset) -> tuple[list[str], list[tuple]]:
    """Header and records of the figure as a table: one impulse a line."""
    samples = _samples(dataset)
    records = []
    for row, ray, tx, rx in np.argwhere(np.isfinite(samples)):
        place = np.s_[row, ray, tx, rx]
        records.append((str(dataset.arrangement.values[row]), f"{np.degrees(dataset.launch_angle.values[ray]):g}",
                        tx, rx, dataset.delay.values[place], int(samples[place]), dataset.intensity.values[place]))
    return ["arrangement", "launch_angle_deg", "tx", "rx", "delay_s", "sample", "intensity"], records


def plot(dataset: xr.Dataset) -> "Figure":
    """Draw the impulses of every arrangement: all of them, the last group, and a part of that."""
    from mitsonar.plots import canvas

    figure = canvas.sheet(1500, 1150)
    panels = figure.subplots(len(ARRANGEMENTS), 3)
    rate, samples = dataset.sampling_rate, _samples(dataset)
    middle = samples[0, SHOWN, 0, 0]
    # the last group of them all, and what one transmit element's three receptions take of it
    wide = 1.15 * np.nanmax(np.abs(samples[:, SHOWN] - middle))
    near = 1.6 * rate * float(dataset.receive_shift.sel(arrangement="3 vertically")[SHOWN])
    for row, (name, axes) in enumerate(zip(dataset.arrangement.values, panels)):
        number, height = _summed(samples[row], dataset.intensity.values[row])
        for axis, (begin, end) in zip(axes, ((0.9 * np.nanmin(samples), 1.05 * np.nanmax(samples)),
                                             (middle - wide, middle + wide), (middle - near, middle + near))):
            axis.vlines(number, 0, height, color="#1f4e79", linewidth=1.3)
            axis.plot(number, height, "o", color="#1f4e79", markersize=3)
            axis.set_xlim(begin, end)
            axis.set_ylim(0, None)
            axis.ticklabel_format(useOffset=False)
            axis.tick_params(labelsize=8)
            axis.grid(alpha=0.25)
        group = (number > middle - wide) & (number < middle + wide)
        axes[2].sharey(axes[1])
        axes[1].set_ylim(0, 1.15 * height[group].max())
        axes[0].set_ylabel(name.replace(", ", ",\n") + "\nintensity", fontsize=10)
        axes[0].set_title(f"{int(np.isfinite(samples[row]).sum())} impulses", fontsize=10)
        axes[1].set_title("last group", fontsize=10)
        axes[2].set_title("its middle", fontsize=10)
    for axis in panels[-1]:
        axis.set_xlabel(f"sample at {rate / 1e6:g} MHz", fontsize=10)
    figure.suptitle("Flat bed, three rays 22° apart: every transmit element received by every receive element",
                    fontsize=14, fontweight="bold")
    figure.tight_layout()
    return figure


def _summed(samples, intensity):
    """Samples that hold impulses, and the sum of them in each."""
    there = np.isfinite(samples)
    number, which = np.unique(samples[there], return_inverse=True)
    return number, np.bincount(which, weights=intensity[there])
