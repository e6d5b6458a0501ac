"""Sonar rays (`sonar_path`): refracted paths to the first hit and the same way back.

- ``rays`` [100000]: per ping, both sides together.
- ``first_pass`` [0.15]: share of them sent first to find where rays are needed (steep faces, targets, far range);
  0 draws all rays for a flat bed.

.. code-block:: xml

    <integrator type="sonar_path"><integer name="rays" value="200000"/></integrator>
"""
import os

import mitsuba as mi
import numpy as np

from mitsonar.imaging import sidescan
from mitsonar.plugins.properties import Attributes
from mitsonar.survey import Survey
from mitsonar.trace import Geometry
from mitsonar.units import db_from_power

BYTES_PER_BIN = 50                 # of the record while it is made and written, all variables together
BINS_PER_PULSE = 10_000


class SonarPath(mi.SamplingIntegrator):
    """See the module's text."""

    def __init__(self, props):
        attributes = Attributes(props)
        self.rays = attributes.integer("rays", 100_000, minimum=1, maximum=1 << 30)
        self.first_pass = attributes.number("first_pass", 0.15, minimum=0, maximum=0.9)
        attributes.finish()
        super().__init__(props)

    def survey(self, scene, sensor):
        """Plan a run of the sensor over the scene.

        Raises
        ------
        ValueError
            If sensor and scene do not fit together: no seabed, a track outside it, a sonar below it, ...
        """
        if not hasattr(sensor, "sonar"):
            raise ValueError("the integrator sonar_path needs a sonar, such as <sensor type=\"sidescan\">, got a "
                             f"{sensor.class_name()}")
        geometry = Geometry(scene)
        track, sonar, below = sensor.plan(geometry, _origin(scene))
        window, bins = sensor.film().window(sonar.sound_speed)
        _check_size(track.pings, bins, window, sonar.pulse_length)
        return Survey(geometry=geometry, profile=sensor.water.profile, sonar=sonar, track=track, depth_below=below,
                      absorption=sensor.water.absorption_column(sonar.frequency), window=window, bins=bins,
                      rays=self.rays, first_pass=self.first_pass)

    def dataset(self, scene, sensor, seed=0, progress=None):
        """Render the sensor's record as an `xarray.Dataset`; see `mitsonar.render`."""
        survey = self.survey(scene, sensor)
        echoes = survey.echoes(seed, progress)
        sonar, track = survey.sonar, survey.track
        noise_db = None
        if sensor.noise:
            noise_db = float(sensor.noise_level_db() + db_from_power(sonar.bandwidth) - sonar.directivity_index_db())
        head = float(np.mean(-track.position[:, 2]))
        return sidescan.image(echoes, sonar=sonar, track=track, depth_below=survey.depth_below, window=survey.window,
                              labels=survey.geometry.labels, noise_db=noise_db, speckle=sensor.speckle, seed=seed,
                              absorption_db=float(survey.absorption.at(head)))

    def render(self, scene, sensor=0, seed=0, spp=0, develop=True, evaluate=True):
        """Echo levels as Mitsuba's image: a tensor (pings, 2 bins, 1), port mirrored, then starboard [dB re 1 µPa]."""
        if isinstance(sensor, int):
            sensor = scene.sensors()[sensor]
        level = self.dataset(scene, sensor, int(np.ravel(seed)[0]))["level"].values
        waterfall = np.concatenate([level[:, 0, ::-1], level[:, 1]], -1)
        image = mi.TensorXf(np.ascontiguousarray(waterfall[..., None]))
        sensor.film().put(image)
        return image

    def to_string(self):
        return f"SonarPath[{self.rays} rays]"


def _check_size(pings, bins, window, pulse_length):
    """Refuse what would end in exhausted memory, or in hours of summing over a pulse of a million bins."""
    bin_length = (window[1] - window[0]) / bins
    if pulse_length > BINS_PER_PULSE * bin_length:
        raise ValueError(f"the film's bins last {1e6 * bin_length:.3g} µs and the pulse {1e6 * pulse_length:.3g} µs, "
                         f"more than {BINS_PER_PULSE} bins; take fewer bins, a longer range or a shorter pulse")
    needed, there = BYTES_PER_BIN * pings * 2 * bins, _memory()
    if needed > there:
        raise ValueError(f"a record of {pings} pings with 2 x {bins} bins takes {needed / 1e9:.0f} GB, more than the "
                         f"{there / 1e9:.0f} GB of this machine; take fewer pings or bins")


def _memory():
    """Physical memory [bytes]; infinite where the system does not say."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return np.inf


def _origin(scene):
    """Easting and northing of the scene's origin, from the first shape that knows them."""
    return next((np.asarray(shape.local_origin, float)[:2] for shape in scene.shapes()
                 if getattr(shape, "local_origin", None) is not None), None)


mi.register_integrator("sonar_path", SonarPath)
