"""Sonar rays (`sonar_path`): refracted paths to the first hit and back.

- ``rays`` [100000]: per ping; of a sidescan both sides together, of arrays per fan and only where rays find cells
- ``first_pass`` [0.15], of a sidescan: share of the rays sent first to find where they are needed (steep faces,
  targets, far range); 0 draws all rays for a flat bed

- ``max_depth`` [1]: bounces that an echo may have made, the sea surface's among them; 2 has ghosts of targets by way of
  the seabed or the surface, 3 surface multiples

Of sonars with arrays:

- ``lighting``: ``scatterers`` [default]: every cell of the scene within reach is connected to the array along its own
  bent ray, without any noise of sampling; ``rays``: rays find the cells, for scenes with too many
- ``cell`` [m]: longest side of a cell, which holds one scatterer; default: half the range resolution, c / 4 B, at most
  a fiftieth of the altitude
- ``fans``: ``centre`` [default]: rays go out from the array's centre, all transmit elements light the same scatterers;
  ``elements``: a fan from every transmit element; ``interpolated``: ``fan_count`` [3] fans along the transmit array,
  elements between take both neighbours'

.. code-block:: xml

    <integrator type="sonar_path"><integer name="rays" value="200000"/></integrator>
"""
from collections.abc import Callable

import mitsuba as mi
import numpy as np
import xarray as xr

from mitsonar.echoes.ensonification import LIGHTING
from mitsonar.plugins.attributes import Attributes
from mitsonar.survey.array_survey import ArraySurvey
from mitsonar.survey.kinds import kind_of
from mitsonar.survey.sensor import RunSettings
from mitsonar.survey.survey import Survey

MOST_BOUNCES = 6
MOST_RAYS = 50_000_000             # of a ping: they are one kernel, of a quarter of a minute, that Ctrl-C waits for


class SonarPath(mi.SamplingIntegrator):
    """See the module's text."""

    def __init__(self, props):
        attributes = Attributes(props)
        fans = attributes.text("fans", "centre", choices=("centre", "elements", "interpolated"))
        if fans != "interpolated" and attributes.given("fan_count"):
            raise attributes.error('fan_count is given, but it only counts with fans "interpolated"; leave it out.')
        self.settings = RunSettings(
            rays=attributes.integer("rays", 100_000, minimum=1, maximum=MOST_RAYS),
            first_pass=attributes.number("first_pass", 0.15, minimum=0, maximum=0.9),
            max_depth=attributes.integer("max_depth", 1, minimum=1, maximum=MOST_BOUNCES),
            ensonification=attributes.text("lighting", LIGHTING[0], choices=LIGHTING),
            cell_size=attributes.number("cell", None, above=0, unit="m"), ray_sources=fans,
            ray_source_count=attributes.integer("fan_count", 3, minimum=2, maximum=1000))
        attributes.finish()
        super().__init__(props)

    def survey(self, scene: mi.Scene, sensor: mi.Sensor) -> Survey:
        """Plan a run of a sonar over a scene.

        Raises
        ------
        ValueError
            If the sensor is no sonar, or sensor and scene do not fit together: no seabed, a track outside it, ...
        """
        return kind_of(sensor).plan(scene, sensor, self.settings)

    def array_survey(self, scene: mi.Scene, sensor: mi.Sensor, lead: float = 0.0) -> ArraySurvey:
        """Plan the same run for the signals of the sonar's elements.

        Parameters
        ----------
        lead : float [-]
            How many pulses earlier than the film's window the record starts: echoes that begin before it last into it.

        Raises
        ------
        ValueError
            As `survey`, or if the samples are too few for the pulse.
        """
        return kind_of(sensor).plan_elements(scene, sensor, self.settings, lead)

    def picture(self, survey: Survey, sensor: mi.Sensor, seed: int = 0,
                progress: Callable[[float, float], None] | None = None,
                say: Callable[[str], None] | None = None) -> xr.Dataset:
        """Render a planned run; see `mitsonar.render`."""
        return kind_of(sensor).picture(survey, sensor, seed, progress, say)

    def render(self, scene, sensor=0, seed=0, spp=0, develop=True, evaluate=True):
        """Echo levels [dB re 1 µPa] as Mitsuba's image, a tensor with one channel.

        (pings, 2 bins) for a sidescan, port mirrored, then starboard; (pings x beams, samples) for an array.
        """
        if isinstance(sensor, int):
            sensor = scene.sensors()[sensor]
        image = self.picture(self.survey(scene, sensor), sensor, int(np.ravel(seed)[0]))
        rows = kind_of(sensor).rows(image["level"].values)
        film = mi.TensorXf(np.ascontiguousarray(rows[..., None]))
        sensor.film().put(film)
        return film

    def to_string(self):
        return f"SonarPath[{self.settings.rays} rays]"


mi.register_integrator("sonar_path", SonarPath)
