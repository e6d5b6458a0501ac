"""Figure 2 of the published method: the impulse response of a sinusoidal seabed in a knife-edge beam.

    r[n] = Σ_k w_k k(n - f_s (t_k - t₀)),        w_k = (i_k / i_k flat) / (rays per sample)

t_k two-way time of ray k, i its returned intensity (`bundles`), flat that of the same ray on the flat bed of the same
mean depth, k a kernel of `signal.impulses`. Rays are spread evenly over time on that flat bed, as published, so that it
would give r = 1 everywhere.

Where the bed faces the sonar squarely, dt/dx = 0, many rays come back within few samples: r ~ |t - t_c|^(-1/2) on one
side of the caustic's time t_c, however many rays are sent. On samples its peak grows with the square root of the
sampling rate, and with shifted impulses it depends on how t_c falls between two samples; every measure is therefore
taken over `SHIFTS` places of the samples.
"""
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mitsonar.propagation.numpy_rays.eigenrays import eigenray
from mitsonar.signal.impulses import KERNELS, element_responses

from .bundles import send, shipped_survey

if TYPE_CHECKING:
    from matplotlib.figure import Figure


__all__ = ["compute", "plot", "rows", "table"]

SCENE = "published_figure_2"
SHIFTS = 32                        # places of the samples, evenly over one sample
DENSER = 16                        # how many times more rays the second bundle has
TABULATED = 8192                   # places on the flat bed that times are tabulated for
PROMINENCE = 0.1                   # [samples] that a time must stand out by to be a caustic, not a facet


def compute(**parameters: object) -> xr.Dataset:
    """Compute the impulse responses and where their caustics lie.

    Parameters
    ----------
    **parameters
        Values for the ``$parameters`` of the scene published_figure_2.

    Returns
    -------
    xarray.Dataset
        ``height`` [m] (place): the bed in the plane of the beam, at ``x`` [m] to starboard. Of the rays sent as the
        scene says: ``hit_x``, ``hit_height`` [m], ``travel_time`` [s, two-way] (ray). ``response`` (bundle, kernel,
        sample) for that bundle and one `DENSER` times as dense, at samples ``time`` [s] that lie where shifted impulses
        peak highest; ``peak`` (bundle, kernel, shift): highest of each response over places of the samples, ``mean``
        (bundle, kernel); ``difference`` (kernel): rms of the two bundles' responses' difference over rms of the dense.
        ``caustic_x`` [m], ``caustic_time`` [s], ``caustic_kind``: places that face the sonar; a "near" one is nearer to
        it than its neighbours, a "far" one farther.

    Raises
    ------
    ValueError, TypeError
        If a parameter is none of the scene's or has a value it cannot take.
    """
    wavy, flat = (shipped_survey(SCENE, **{**parameters, **changed}) for changed in ({}, {"height": 0}))
    x, height = _section(wavy.world.still)
    bundles = [_Rays(wavy, flat, wavy.rays * factor) for factor in (1, DENSER)]
    few, many = bundles
    caustics = _caustics(many, wavy.sampling_rate)
    responses = np.array([[[_response(rays, wavy, kernel, shift / SHIFTS) for shift in range(SHIFTS)]
                           for kernel in KERNELS] for rays in bundles])
    peak = responses.max(-1)
    shown = peak[0, list(KERNELS).index("nearest")].argmax()
    difference = np.sqrt(np.mean((responses[0] - responses[1]) ** 2, (1, 2)) / np.mean(responses[1] ** 2, (1, 2)))
    return xr.Dataset(
        {"height": ("place", height, {"units": "m"}),
         "hit_x": ("ray", few.x, {"units": "m"}),
         "hit_height": ("ray", few.height, {"units": "m"}),
         "travel_time": ("ray", few.time, {"units": "s", "long_name": "two-way"}),
         "response": (("bundle", "kernel", "sample"), responses[:, :, shown], {"long_name": "re flat bed"}),
         "peak": (("bundle", "kernel", "shift"), peak),
         "mean": (("bundle", "kernel"), responses.mean((2, 3))),
         "difference": ("kernel", difference),
         "caustic_x": ("caustic", many.x[caustics], {"units": "m"}),
         "caustic_time": ("caustic", many.time[caustics], {"units": "s", "long_name": "two-way"}),
         "caustic_kind": ("caustic", _kinds(many.time, caustics))},
        coords={"x": ("place", x, {"units": "m"}),
                "time": ("sample", wavy.time + shown / SHIFTS / wavy.sampling_rate, {"units": "s"}),
                "kernel": list(KERNELS), "bundle": ["scene", "dense"],
                "rays": ("bundle", [len(rays.time) for rays in bundles]),
                "shift": np.arange(SHIFTS) / SHIFTS},
        attrs={"sampling_rate": wavy.sampling_rate, "rays_per_sample": few.per_sample,
               "source_height": float(wavy.track.position[0, 2]), "scene": SCENE})


class _Rays:
    """A bundle spread evenly over time on the flat bed."""

    def __init__(self, wavy, flat, count):
        angle, step = _even_in_time(flat, count)
        start = np.zeros((count, 3))
        hits, reference = send(wavy, start, angle), send(flat, start, angle)
        self.per_sample = 1 / (step * wavy.sampling_rate)
        self.x, self.height = hits.point[:, 0], hits.point[:, 2]
        self.time = 2 * hits.travel_time
        self.weight = hits.intensity / reference.intensity / self.per_sample


def _even_in_time(survey, count):
    """Launch angles [rad] of rays whose echoes from a flat bed fill the record evenly, and the step in time [s]."""
    depth, bed = -survey.track.position[0, 2], survey.world.depth_range[1]
    end = survey.time[-1]
    x = np.linspace(0, 0.5 * end * np.max(survey.waters.only.profile.sound_speed), TABULATED)
    time = 2 * eigenray(survey.waters.only.profile, depth, bed, x).travel_time
    step = (end - time[0]) / count
    # x² is smooth in time, x is not at the nadir
    reached = np.sqrt(np.interp(time[0] + (np.arange(count) + 0.5) * step, time, x ** 2))
    return eigenray(survey.waters.only.profile, depth, bed, reached).launch_angle, step


def _section(geometry):
    """The bed along x in the plane of the beam, from the row of vertices nearest to it."""
    vertex = geometry.vertices.numpy().reshape(-1, 4)[:, :3].astype(float)
    row = vertex[np.abs(vertex[:, 1]) <= np.abs(vertex[:, 1]).min() + 1e-6]
    row = row[np.argsort(row[:, 0])]
    return row[:, 0], row[:, 2]


def _response(rays, survey, kernel, shift):
    """Real impulse response (sample,), the samples `shift` of a sample late."""
    there = np.isfinite(rays.weight)
    start = survey.start + shift / survey.sampling_rate
    # as published, impulses have no carrier: intensities add
    return element_responses(delay=rays.time[there, None], amplitude=rays.weight[there], frequency=0.0,
                             sampling_rate=survey.sampling_rate, samples=survey.samples, start=start,
                             kernel=kernel)[0].real


def _caustics(rays, sampling_rate):
    """Numbers of the rays at the turning points of time, in order."""
    from scipy.signal import find_peaks

    return np.sort(np.concatenate([find_peaks(sign * rays.time, prominence=PROMINENCE / sampling_rate)[0]
                                   for sign in (1, -1)]))


def _kinds(time, caustics):
    return ["near" if time[k] < time[k - 1] else "far" for k in caustics]


def table(dataset: xr.Dataset) -> str:
    """Say in words and numbers what the figure shows."""
    few, many = dataset.rays.values
    lines = [f"{few} rays, {dataset.rays_per_sample:.3g} a sample at {dataset.sampling_rate / 1000:g} kHz; response 1 "
             "is that of the flat bed",
             "", "caustics, where the bed faces the sonar:   x [m]   two-way time [ms]"]
    for x, time, kind in zip(dataset.caustic_x.values, dataset.caustic_time.values, dataset.caustic_kind.values):
        lines.append(f"{kind:>41}{x:9.3f}{1000 * time:15.4f}")
    denser = f"{DENSER} x rays"
    lines += ["", f"{'kernel':14}{'peak to mean':>14}{'lowest..highest peak':>24}{denser:>20}{'rms change':>12}"]
    for kernel in dataset.kernel.values:
        one = dataset.sel(kernel=kernel)
        peak, dense = (one.peak.sel(bundle=bundle).values for bundle in ("scene", "dense"))
        spread, dense = (f"{values.min():.2f}..{values.max():.2f}" for values in (peak, dense))
        lines.append(f"{kernel:14}{peak.max() / float(one['mean'][0]):14.2f}{spread:>24}{dense:>20}"
                     f"{100 * float(one.difference):10.2f} %")
    highest = dataset.peak.sel(bundle="scene").max("shift")
    lower = 1 - float(highest.sel(kernel="peterson") / highest.sel(kernel="nearest"))
    lines += ["", f"peaks over {SHIFTS} places of the samples; Peterson's highest is {100 * lower:.0f} % below that of "
                  "shifted impulses"]
    return "\n".join(lines)


def rows(dataset: xr.Dataset) -> tuple[list[str], np.ndarray]:
    """Header and records of the figure as a table: the responses over time."""
    pairs = [(bundle, kernel) for bundle in dataset.bundle.values for kernel in dataset.kernel.values]
    columns = [dataset.response.sel(bundle=bundle, kernel=kernel).values for bundle, kernel in pairs]
    return ["time_s", *(f"{bundle}_{kernel}" for bundle, kernel in pairs)], np.stack([dataset.time.values, *columns], 1)


def plot(dataset: xr.Dataset) -> "Figure":
    """Draw the bed, the two responses, and the caustics from near by."""
    from mitsonar.plots import canvas

    figure = canvas.sheet(1500, 900)
    (bed, shifted), (close, smooth) = figure.subplots(2, 2, width_ratios=(1, 1.25))
    _draw_bed(bed, dataset)
    colours = {"nearest": "#1f1f1f", "peterson": "#1f4e79"}
    titles = {"nearest": "shifted impulses", "peterson": "Peterson's impulses"}
    time = 1000 * dataset.time.values
    seen = dataset.response.sel(bundle="scene")
    top = 1.08 * float(seen.sel(kernel=list(titles)).max())
    for axes, (kernel, title) in zip((shifted, smooth), titles.items()):
        axes.plot(time, seen.sel(kernel=kernel), color=colours[kernel], linewidth=0.8)
        peak = dataset.peak.sel(bundle="scene", kernel=kernel)
        axes.set_title(f"impulse response, {title}: peak {float(peak.min()):.1f} to {float(peak.max()):.1f} "
                       "over places of samples", fontsize=11)
        axes.set_xlim(time[0], time[-1])
        axes.set_ylim(-1.5, top)
    for kernel, colour in colours.items():
        close.plot(time, seen.sel(kernel=kernel), color=colour, linewidth=1, marker="o", markersize=3, label=kernel)
    close.plot(time, dataset.response.sel(bundle="dense", kernel="peterson"), color="#b86f22", linewidth=1,
               linestyle="--", label=f"peterson, {DENSER} × rays")
    caustics = 1000 * dataset.caustic_time.values
    for place in caustics:
        close.axvline(place, color="#b3261e", linewidth=0.8, alpha=0.6)
    if caustics.size:
        close.set_xlim(caustics.min() - 0.4, caustics.max() + 0.4)
    close.set_title("the caustics (red) from near by", fontsize=11)
    close.legend(loc="upper center", fontsize=9)
    for axes in (shifted, smooth, close):
        axes.set_xlabel("two-way time [ms]", fontsize=10)
        axes.set_ylabel("intensity re flat bed", fontsize=10)
        axes.grid(alpha=0.25)
    figure.suptitle("Sinusoidal seabed in a knife-edge beam: peaks where rays crowd into few samples", fontsize=14,
                    fontweight="bold")
    figure.tight_layout()
    return figure


def _draw_bed(axes, dataset):
    """The section, a few of the rays and the places that face the sonar."""
    seen = dataset.x >= 0
    axes.plot(dataset.x[seen], dataset.height[seen], color="#7a3c10", linewidth=1.4)
    some = slice(None, None, max(1, dataset.sizes["ray"] // 50))
    for x, z in zip(dataset.hit_x.values[some], dataset.hit_height.values[some]):
        axes.plot([0, x], [dataset.source_height, z], color="#1f4e79", linewidth=0.3, alpha=0.6)
    height = np.interp(dataset.caustic_x, dataset.x, dataset.height)
    axes.plot(dataset.caustic_x, height, "o", color="#b3261e", markersize=5, label="faces the sonar")
    axes.set_title("synthetic sinusoidal seabed", fontsize=11)
    axes.set_xlabel("across track [m]", fontsize=10)
    axes.set_ylabel("z [m]", fontsize=10)
    axes.set_xlim(0, 1.02 * float(np.nanmax(dataset.hit_x)))
    axes.legend(loc="upper right", fontsize=9)
    axes.grid(alpha=0.25)
