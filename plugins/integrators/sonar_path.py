"""Sonar rays (`sonar_path`): refracted paths to the first hit and back.

For a sidescan, a first pass finds where rays are needed: steep faces, targets, far range. On a flat bed 10 rays a bin
leave 0.4 dB rms of ray noise, 100 rays 0.1 dB.

For sonars with arrays, the seabed is cut into cells. Each cell has one scatterer: a fixed point with a complex Gaussian
amplitude, the same for every element, ping and run. Speckle is therefore Rayleigh, and coherent from ping to ping.
Meshes and rectangles carry scatterers.

.. code-block:: xml

    <integrator type="sonar_path"><integer name="rays" value="200000"/></integrator>
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.turns import one_at_a_time
from mitsonar.survey.sensor import RunSettings, Sensor, sonar_of

from ..attributes import Attributes, Choice, Integer, Number

if TYPE_CHECKING:                   # what renders is imported where it is asked for: a scene is loaded without it
    import xarray as xr

    from mitsonar.gradients.elements.coherent_levels import CoherentLevels
    from mitsonar.gradients.records.level_products import LevelProducts
    from mitsonar.imaging.recording import PingRecorder
    from mitsonar.survey.pressure.array_survey import ArraySurvey
    from mitsonar.survey.survey import Survey

MOST_BOUNCES = 6
MOST_RAYS = 50_000_000             # of a ping: they are one kernel, of a quarter of a minute, that Ctrl-C waits for

ATTRIBUTES = (
    Integer("rays", default=100_000, minimum=1, maximum=MOST_RAYS,
            text="rays per ping: of a sidescan, for both sides together; of an array, those of paths of several "
                 "bounces, of `ensonification` `rays`, and at least as many points of the water"),
    Number("first_pass", default=0.15, minimum=0, maximum=0.9,
           text="share of a sidescan's rays that are traced first, to find where rays are needed, by one of up to "
                "four pings over the same ground; 0: rays are drawn as for a flat bed"),
    Integer("max_depth", default=1, minimum=1, maximum=MOST_BOUNCES,
            text="greatest number of bounces of an echo, including those at the surface; 2: ghosts by way of the "
                 "seabed or the surface, 3: surface multiples"),
    Choice("ensonification", default="scatterers", choices=("scatterers", "rays"),
           text="method to find the echoes of an array's cells: `scatterers` connects each cell within reach to the "
                "array along its own bent ray; `rays` finds cells with `rays` rays, for scenes with too many cells"),
    Number("cell", default=None, above=0, unit="m", otherwise="half the range resolution",
           text="longest side of a cell, for signals of elements; by default at most a fiftieth of the altitude and, "
                "for a synthetic aperture, as `scatterers_per_cell` needs"),
    Number("scatterers_per_cell", default=5.0, minimum=1, maximum=100,
           text="number of scatterers in a resolution cell, for pictures made in the beam domain, synthetic apertures "
                "and the speckle of a sidescan"),
    Choice("fans", default="centre", choices=("centre", "elements", "interpolated"),
           text="places from which an array's cells are ensonified: its centre (all transmit elements reach the same "
                "points), each transmit element, or `fan_count` places along the array, where each element takes the "
                "echoes of both neighbouring places"),
    Integer("fan_count", default=3, minimum=2, maximum=1000, only=("fans", ("interpolated",)),
            text="number of places, with `interpolated`"),
    Integer("ground_seed", default=None, minimum=0, maximum=(1 << 32) - 1, otherwise="the seed of the render",
            text="seed of the scatterers of seabed and objects: the same ground has the same speckle for every kind of "
                 "sonar; write it to draw other noise over the same ground by other seeds"),
)


class SonarPath(mi.SamplingIntegrator):
    """Integrator of sonar scenes."""

    def __init__(self, props: mi.Properties) -> None:
        attributes = Attributes(props, ATTRIBUTES)
        self._ground_seed = attributes.ground_seed
        self.settings = RunSettings(
            rays=attributes.rays, first_pass=attributes.first_pass, max_depth=attributes.max_depth,
            ensonification=attributes.ensonification, cell_size=attributes.cell,
            scatterers_per_cell=attributes.scatterers_per_cell, ray_sources=attributes.fans,
            ray_source_count=attributes.fan_count)
        super().__init__(props)

    def survey(self, scene: mi.Scene, sensor: Sensor, seed: int = 0) -> Survey:
        """Plan a run of a sonar over a scene, whose scatterers are drawn by the seed."""
        from mitsonar.survey.bending import warn_of_bending
        from mitsonar.survey.coverage import warn_of_window
        from mitsonar.survey.kinds import kind_of

        survey = kind_of(sensor).plan(scene, sensor, self._settings(seed))
        warn_of_window(survey, sensor)
        warn_of_bending(survey, sensor)
        return survey

    def array_survey(self, scene: mi.Scene, sensor: Sensor, lead: float = 0.0, seed: int = 0) -> ArraySurvey:
        """Plan the same run for the signals of the sonar's elements."""
        from mitsonar.survey.bending import warn_of_bending
        from mitsonar.survey.coverage import warn_of_window
        from mitsonar.survey.kinds import kind_of

        survey = kind_of(sensor).plan_elements(scene, sensor, self._settings(seed), lead)
        warn_of_window(survey, sensor)
        warn_of_bending(survey, sensor)
        return survey

    def _settings(self, seed: int) -> RunSettings:
        """Return the settings of a run, with the seed of the scatterers."""
        return replace(self.settings, seed=int(seed) if self._ground_seed is None else self._ground_seed)

    def picture(self, survey: Survey, sensor: Sensor, seed: int = 0,
                progress: Callable[[float, float], None] | None = None,
                say: Callable[[str], None] | None = None) -> xr.Dataset:
        """Render a planned run; see `mitsonar.render`."""
        from mitsonar.survey.kinds import kind_of

        image = kind_of(sensor).picture(survey, sensor, sensor.own_seed(seed), progress, say)
        if sensor.recorder is not None:
            image = _recording(survey, sensor, seed).added(image)
        return image if sensor.leader is None else image.assign_attrs(seed=int(seed))

    def frame(self, survey: Survey, sensor: Sensor, seed: int = 0) -> Callable[[int], xr.Dataset]:
        """Return the function that renders the picture of one ping; see `mitsonar.frames` and `mitsonar.Sonar`."""
        from mitsonar.survey.kinds import stepped_kind_of

        render = stepped_kind_of(sensor).frame(survey, sensor, sensor.own_seed(seed))
        recording = None if sensor.recorder is None else _recording(survey, sensor, seed)

        def of(ping: int) -> xr.Dataset:
            image = render(ping) if recording is None else recording.added(render(ping))
            return image if sensor.leader is None else image.assign_attrs(seed=int(seed))

        return of

    @one_at_a_time
    def render(self, scene: mi.Scene, sensor: mi.Sensor | int = 0, seed: int = 0, spp: int = 0, develop: bool = True,
               evaluate: bool = True) -> mi.TensorXf:
        """Echo levels [dB re 1 µPa] as Mitsuba's image, a tensor with one channel.

        (pings, 2 bins) for a sidescan, port mirrored, then starboard; (pings x beams, samples) for an array. Where
        anything in the scene carries a gradient, seabeds are met by normals between their nodes; where elements or
        point targets do, beams are formed of the elements' signals.
        """
        sonar = sonar_of(scene.sensors()[sensor] if isinstance(sensor, int) else sensor)
        rows = self._levels(scene, sonar, int(np.ravel(seed)[0]))
        film = mi.TensorXf(np.ascontiguousarray(rows[..., None]))
        sonar.film().put(film)
        return film

    def _levels(self, scene: mi.Scene, sonar: Sensor, seed: int) -> np.ndarray:
        """Return levels (rows, columns)."""
        from mitsonar.gradients.elements.coherent_levels import CoherentLevels, is_coherent
        from mitsonar.gradients.records.level_products import wants_gradients
        from mitsonar.survey.kinds import kind_of

        if wants_gradients(scene) and is_coherent(scene, sonar):
            return CoherentLevels(scene, sonar, seed).levels
        survey = self.survey(scene, sonar, seed)
        if wants_gradients(scene):
            survey = replace(survey, world=survey.world.smoothed())
        return kind_of(sonar).rows(self.picture(survey, sonar, seed)["level"].values)

    @one_at_a_time
    def render_forward(self, scene: mi.Scene, params: mi.SceneParameters, sensor: mi.Sensor | int = 0, seed: int = 0,
                       spp: int = 0) -> mi.TensorXf:
        """Return the derivative of the levels of `render` [dB] along the tangents set in the scene."""
        return mi.TensorXf(self._products(scene, sensor, seed).forward().astype(np.float32)[..., None])

    @one_at_a_time
    def render_backward(self, scene: mi.Scene, params: mi.SceneParameters, grad_in: mi.TensorXf,
                        sensor: mi.Sensor | int = 0, seed: int = 0, spp: int = 0) -> None:
        """Propagate gradients by the levels of `render` [1/dB] to the scene's parameters."""
        weights = np.array(dr.detach(grad_in), float)
        self._products(scene, sensor, seed).backward(weights[..., 0])

    def _products(self, scene: mi.Scene, sensor: mi.Sensor | int, seed: int) -> LevelProducts | CoherentLevels:
        from mitsonar.gradients.elements.coherent_levels import CoherentLevels, is_coherent
        from mitsonar.gradients.records.level_products import LevelProducts

        sonar = sonar_of(scene.sensors()[sensor] if isinstance(sensor, int) else sensor)
        if is_coherent(scene, sonar):
            return CoherentLevels(scene, sonar, int(np.ravel(seed)[0]))
        return LevelProducts(scene, sonar, self, int(np.ravel(seed)[0]))

    def to_string(self) -> str:
        return f"SonarPath[{self.settings.rays} rays]"


def _recording(survey: Survey, sensor: Sensor, seed: int) -> PingRecorder:
    """Return a sonar's recorder at work, in the water at its mean depth."""
    from mitsonar.imaging.recording import PingRecorder

    assert sensor.recorder is not None
    return PingRecorder(sensor.recorder, sensor.own_seed(seed),
                     absorption_db=float(survey.waters.first.absorption.at(survey.planned_depth)))


mi.register_integrator("sonar_path", SonarPath)
