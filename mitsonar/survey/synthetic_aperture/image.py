"""Raw echoes of a strip ping by ping, the image focused from them, and the truth of every point.

Raw records have the format of `synthetic_aperture.record`; every ping repeats the data that are common to all pings.
"""
from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import drjit as dr
import numpy as np
import xarray as xr

from mitsonar.hydrography.detection.bottom_backscatter import mean_absorption
from mitsonar.scene import objects
from mitsonar.scene.labels import classes_of
from mitsonar.synthetic_aperture.focusing.focusing import Focuser
from mitsonar.synthetic_aperture.focusing.grids import Grid, default_grid
from mitsonar.synthetic_aperture.record import RAW_VARIABLES

from ..pressure.cost import sentence
from ..pressure.pressure import PressureRecord
from ..pressure.signals import received_signals
from .plan import StripSurvey
from .truth import strip_truth

RATE = 200.0                       # [Hz] of the trajectory: error of splines through it: 1e-6 m for the fastest strum
MARGIN = 0.05                      # [s] before the first transmission and after the last reception


def raw_pings(survey: StripSurvey, seed: int, start: int = 0, *, kernel: str = "band_limited",
              return_path: str = "vector") -> Iterator[xr.Dataset]:
    """Yield the raw echoes of pings from `start` on; the echoes of a ping do not depend on `start`."""
    record = PressureRecord(survey, seed=seed, kernel=kernel, return_path=return_path)
    known = common(survey)
    for ping in range(start, survey.track.pings):
        signals = received_signals(record, [ping])
        yield known.assign({name: RAW_VARIABLES.variable(name, values) for name, values in (
            ("signal", signals.values[:, 0]), ("ping_time", survey.track.time[[ping]]),
            ("transmitter", np.array([survey.sender(ping)], np.int32)))}).assign_coords(ping=[ping])


def common(survey: StripSurvey) -> xr.Dataset:
    """Return the data common to all pings of a strip: arrays, trajectory, water, targets and attributes."""
    trajectory, track, water = survey.voyage.trajectory, survey.track, survey.waters.first
    first = track.time[0] - MARGIN
    count = int(np.ceil((track.time[-1] + survey.time[-1] + MARGIN - first) * RATE)) + 1
    time = first + np.arange(count) / RATE
    position, attitude = trajectory.pose(time)
    values = {
        "time": survey.time[survey.lead:], "tx_position": survey.transmit.position,
        "rx_position": survey.receive.position, "rx_bank": survey.bank.astype(np.int32),
        "motion_time": time, "motion_x": position[:, 0], "motion_y": position[:, 1], "motion_depth": -position[:, 2],
        "motion_roll": attitude[:, 0], "motion_pitch": attitude[:, 1], "motion_heading": np.unwrap(attitude[:, 2]),
        "cast_depth": water.profile.depth, "cast_sound_speed": water.profile.sound_speed, **_targets(survey)}
    top = -float(track.position[:, 2].mean())
    return xr.Dataset({name: RAW_VARIABLES.variable(name, part) for name, part in values.items()}, attrs={
        "sonar": "synthetic_aperture", "preset": survey.preset, "frequency": survey.frequency,
        "sampling_rate": survey.sampling_rate, "pulse": survey.pulse.numbers,
        "source_level_db": survey.source_level_db,
        "absorption_db": float(mean_absorption(water.absorption, top, max(survey.bed_depth, top + 1.0))),
        "look": [float(part) for part in survey.look], "tx_length": survey.transmit.length,
        "rx_length": survey.receive.length, "bed_depth": survey.bed_depth})


def _targets(survey: StripSurvey) -> dict[str, np.ndarray]:
    """Return the point targets of the scene."""
    targets, water = survey.world.still.targets(), survey.waters.first
    place = np.array([target.position for target in targets], float).reshape(-1, 3)
    return {"target_x": place[:, 0], "target_y": place[:, 1], "target_depth": -place[:, 2],
            "target_strength_db": np.array([
                target.strength_at(survey.frequency, float(water.profile.at(-target.position[2])))
                for target in targets], float),
            "target_name": np.array([survey.labels[target.label] for target in targets], str)}


Progress = Callable[[float, float], None]


def strip_image(survey: StripSurvey, seed: int, progress: Progress | None = None,
                say: Callable[[str], None] | None = None) -> xr.Dataset:
    """Return the image of a strip on the grid of its sensor, with its truth; memory does not grow with the pings."""
    if say is not None:
        cost = sentence(PressureRecord(survey, seed=seed), range(survey.track.pings), threads=dr.thread_count())
        if cost:
            say(cost)
    image = focused(raw_pings(survey, seed), survey.track.pings, progress, grid=survey_grid(survey),
                    window=survey.aperture_window, range_window=survey.range_window)
    return with_truth(image.assign_attrs(seed=seed), survey, seed)


def survey_grid(survey: StripSurvey) -> Grid:
    """Return the grid of a strip's sensor; raise `ValueError` if the strip has only one ping."""
    if survey.track.pings < 2:
        raise ValueError("An aperture needs two or more pings, but the strip has one. Set pings to 2 or more, or "
                         "compute only its raw echoes.")
    return default_grid(common(survey).assign(ping_time=("ping", survey.track.time)), spacing=survey.grid_spacing,
                        kind=survey.grid)


def focused(pings: Iterable[xr.Dataset], count: int, progress: Progress | None = None, **options: Any) -> xr.Dataset:
    """Return the image focused from pings, which are read one by one; `options` are those of `Focuser`."""
    focuser: Focuser | None = None
    for done, ping in enumerate(pings, 1):
        if focuser is None:
            focuser = Focuser(ping, **options)
        focuser.add(ping)
        if progress is not None:
            progress(done, count)
    if focuser is None:
        raise ValueError("There are no pings to focus; give two or more.")
    return focuser.image()


def with_truth(image: xr.Dataset, survey: StripSurvey, seed: int) -> xr.Dataset:
    """Return a focused image of a survey with the truth of every point added."""
    truth = strip_truth(survey, image["x"].values, image["y"].values, image["grid_depth"].values, seed)
    image = image.assign(truth.data_vars).assign_coords(truth.coords)
    image = image.assign_attrs(labels={str(number): name for number, name in survey.labels.items()})
    classes, class_of = classes_of(survey.labels)
    if "share" in truth:
        return objects.annotated(image, classes, class_of, survey.world.still, survey.track.position)
    return image.assign_attrs(objects.known(classes, class_of, survey.world.still, survey.track.position))
