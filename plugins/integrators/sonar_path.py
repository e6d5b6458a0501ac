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
import os

import mitsuba as mi
import numpy as np

from mitsonar.echoes.ensonification import LIGHTING
from mitsonar.imaging import fan, sidescan
from mitsonar.plugins.attributes import Attributes
from mitsonar.scene import materials, objects as scene_objects
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.labels import classes_of
from mitsonar.signal.noise import ElementNoise
from mitsonar.sonar import element_directivity_index_db
from mitsonar.survey.energy import SidescanSurvey
from mitsonar.survey.pressure import ArraySurvey
from mitsonar.survey.sources import Fans
from mitsonar.survey.signals import LEAD, received_signals
from mitsonar.units import db_from_power

BYTES_PER_BIN = 90                 # of the record while it is made and written, all variables together,
BYTES_PER_LABEL = 13               # and of each shape's share,
BYTES_PER_SUM = 72                 # of a ping of a fan, each bin and shape, while its truth is made
BYTES_PER_PATH = 12                # and of each path where there is more than one
BINS_PER_PULSE = 10_000
MOST_BOUNCES = 6
MOST_RAYS = 50_000_000             # of a ping: they are one kernel, of a quarter of a minute, that Ctrl-C waits for
CELL_SHARE = 0.02                  # of the altitude that a cell spans at most, where the scene does not say


class SonarPath(mi.SamplingIntegrator):
    """See the module's text."""

    def __init__(self, props):
        attributes = Attributes(props)
        self.rays = attributes.integer("rays", 100_000, minimum=1, maximum=MOST_RAYS)
        self.first_pass = attributes.number("first_pass", 0.15, minimum=0, maximum=0.9)
        self.max_depth = attributes.integer("max_depth", 1, minimum=1, maximum=MOST_BOUNCES)
        self.lighting = attributes.text("lighting", LIGHTING[0], choices=LIGHTING)
        self.cell_size = attributes.number("cell", None, above=0, unit="m")
        self.fans = attributes.text("fans", "centre", choices=("centre", "elements", "interpolated"))
        if self.fans != "interpolated" and attributes.given("fan_count"):
            raise attributes.error('fan_count is given, but it only counts with fans "interpolated"; leave it out.')
        self.fan_count = attributes.integer("fan_count", 3, minimum=2, maximum=1000)
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
        voyage, sonar, below = sensor.plan(geometry, *_origin(scene))
        window, bins = sensor.film().window(sonar.sound_speed)
        materials.check(geometry, sensor.water.profile, sonar.frequency)
        survey = SidescanSurvey(
            geometry=geometry, profile=sensor.water.profile, sonar=sonar, voyage=voyage, depth_below=below,
            absorption=sensor.water.absorption_column(sonar.frequency), window=window, bins=bins, rays=self.rays,
            first_pass=self.first_pass, max_depth=self.max_depth, volume=sensor.water.volume)
        _check_size(survey)
        return survey

    def array_survey(self, scene, sensor, lead=0.0):
        """Plan a run of a sensor with arrays over the scene.

        Parameters
        ----------
        lead : float [-]
            How many pulses earlier than the film's window the record starts: echoes that begin before it last into it.

        Returns
        -------
        ArraySurvey

        Raises
        ------
        ValueError
            If sensor and scene do not fit together, or the samples are too few for the pulse.
        """
        if not hasattr(sensor, "array_plan"):
            raise ValueError("element signals need a sonar, such as <sensor type=\"array_sonar\">, got a "
                             f"{sensor.class_name()}")
        geometry = Geometry(scene)
        plan = sensor.array_plan(geometry, *_origin(scene))
        pulse, speed = plan.pulse, plan.sound_speed
        materials.check(geometry, sensor.water.profile, pulse.frequency)
        # echoes from ahead and astern lie 2 v f / c up and down; two thirds of the sampled band are flat
        doppler = 2 * float(np.linalg.norm(plan.voyage.velocity, axis=1).max()) * pulse.frequency / speed
        start, rate, samples = sensor.film().sampling(speed, pulse.suggested_sampling_rate + 3 * doppler,
                                                       written=plan.bins_are_samples)
        extra = int(np.ceil(lead * pulse.duration * rate))
        fans = {"centre": Fans.from_centre, "elements": Fans.from_elements,
                "interpolated": lambda transmit: Fans.interpolated(transmit, self.fan_count)}[self.fans]
        return ArraySurvey(
            geometry=geometry, profile=sensor.water.profile, absorption=sensor.water.absorption_column(pulse.frequency),
            pulse=pulse, source_level_db=plan.source_level_db, transmit=plan.transmit, receive=plan.receive,
            voyage=plan.voyage, depth_below=plan.depth_below,
            start=start - extra / rate, sampling_rate=rate, samples=samples + extra, lead=extra, lighting=self.lighting,
            cell_size=self.cell_size or _cell_size(plan), rays=self.rays, fans=fans(plan.transmit),
            noise=_element_noise(sensor, plan, rate), absorption_db=sensor.water.mean_absorption(
                -float(plan.voyage.track.position[:, 2].mean()), geometry.depth_range[1]),
            max_depth=self.max_depth, volume=sensor.water.volume)

    def dataset(self, scene, sensor, seed=0, progress=None, say=None):
        """Render the sensor's record as an `xarray.Dataset`; see `mitsonar.render`."""
        if hasattr(sensor, "fan_width"):
            return self._fan(scene, sensor, seed, progress, say)
        survey = self.survey(scene, sensor)
        echoes = survey.echoes(seed, progress)
        sonar, track = survey.sonar, survey.track
        noise_db = None
        if sensor.noise:
            noise_db = float(sensor.noise_level_db() + db_from_power(sonar.bandwidth) - sonar.directivity_index_db())
        head = float(np.mean(-track.position[:, 2]))
        classes, class_of = classes_of(survey.labels)
        image = sidescan.image(echoes, sonar=sonar, track=track, depth_below=survey.depth_below, window=survey.window,
                               labels=survey.labels, class_of=class_of, paths=survey.paths.names, noise_db=noise_db,
                               speckle=sensor.speckle, seed=seed, absorption_db=float(survey.absorption.at(head)))
        return _described(image, classes, class_of, survey.geometry)

    def _fan(self, scene, sensor, seed, progress, say):
        """The picture that an array's beams make, with the truth of its bins."""
        survey = self.array_survey(scene, sensor, LEAD)
        pings = range(survey.track.pings)
        beams = fan.fan_directions(survey.receive, sensor.beams, sensor.fan_width)
        _check_fan_size(survey, len(beams[0]))
        truth = survey.fan_truth(*beams, seed)               # refuses what is too large before the hours of signals
        signals = received_signals(survey, pings, kernel="band_limited", return_path="vector", seed=seed,
                                   progress=progress, say=say)
        known = [truth(ping) for ping in pings]
        classes, class_of = classes_of(survey.labels)
        image = fan.image(signals, survey.pulse, *beams, depth_below=survey.depth_below, labels=survey.labels,
                          class_of=class_of, known={name: np.stack([one[name] for one in known]) for name in known[0]})
        return _described(image, classes, class_of, survey.geometry)

    def render(self, scene, sensor=0, seed=0, spp=0, develop=True, evaluate=True):
        """Echo levels [dB re 1 µPa] as Mitsuba's image, a tensor with one channel.

        (pings, 2 bins) for a sidescan, port mirrored, then starboard; (pings x beams, samples) for an array.
        """
        if isinstance(sensor, int):
            sensor = scene.sensors()[sensor]
        level = self.dataset(scene, sensor, int(np.ravel(seed)[0]))["level"].values
        rows = level.reshape(-1, level.shape[-1])
        if hasattr(sensor, "sonar"):
            rows = np.concatenate([level[:, 0, ::-1], level[:, 1]], -1)
        image = mi.TensorXf(np.ascontiguousarray(rows[..., None]))
        sensor.film().put(image)
        return image

    def to_string(self):
        return f"SonarPath[{self.rays} rays]"


def _described(image, classes, class_of, geometry):
    """The image with what it says of its scene."""
    image = image.assign_attrs(classes={str(number): name for number, name in classes.items()},
                               label_class={str(label): number for label, number in class_of.items()},
                               **scene_objects.described(geometry))
    return image.assign_attrs(unseen=scene_objects.unseen(image))


def _cell_size(plan):
    """Half the range resolution, but no more than beams resolve across: a fraction of the altitude."""
    return min(plan.sound_speed / (4 * plan.pulse.bandwidth), max(float(np.mean(plan.depth_below)), 1.0) * CELL_SHARE)


def _element_noise(sensor, plan, sampling_rate):
    """Noise of the sea, less what the elements' own beams keep out, and of the receivers; None where there is none."""
    own_db = getattr(sensor, "self_noise_db", None)
    if not sensor.noise and own_db is None:
        return None
    wavelength = plan.sound_speed / plan.pulse.frequency
    ambient_db = None
    if sensor.noise:
        ambient_db = sensor.noise_level_db() - element_directivity_index_db(plan.receive, wavelength)
    return ElementNoise(position=plan.receive.position, wavelength=wavelength, sampling_rate=sampling_rate,
                        ambient_db=ambient_db, self_noise_db=own_db)


def _check_size(survey):
    """Refuse what would end in exhausted memory, or in hours of summing over a pulse of a million bins."""
    pings, bins, paths = survey.track.pings, survey.bins, len(survey.paths)
    bin_length, pulse_length = survey.bin_length, survey.sonar.pulse_length
    if pulse_length > BINS_PER_PULSE * bin_length:
        raise ValueError(f"the film's bins last {1e6 * bin_length:.3g} µs and the pulse {1e6 * pulse_length:.3g} µs, "
                         f"more than {BINS_PER_PULSE} bins; take fewer bins, a longer range or a shorter pulse")
    per_bin = BYTES_PER_BIN + BYTES_PER_LABEL * len(survey.labels) + (BYTES_PER_PATH * paths if paths > 1 else 0)
    needed, there = per_bin * pings * 2 * bins, _memory()
    if needed > there:
        by_path, fewer = (f" and {paths} paths", "pings, bins or bounces") if paths > 1 else ("", "pings or bins")
        raise ValueError(f"a record of {pings} pings with 2 x {bins} bins{by_path} takes {needed / 1e9:.0f} GB, more "
                         f"than the {there / 1e9:.0f} GB of this machine; take fewer {fewer}")


def _check_fan_size(survey, beams):
    """Refuse what would end in exhausted memory."""
    pings, bins, labels = survey.track.pings, beams * (survey.samples - survey.lead), len(survey.labels)
    needed, there = bins * (labels * BYTES_PER_SUM + pings * (BYTES_PER_BIN + BYTES_PER_LABEL * labels)), _memory()
    if needed > there:
        raise ValueError(f"pictures of {pings} pings with {bins} bins of {beams} beams and {labels} shapes take "
                         f"{needed / 1e9:.0f} GB, more than the {there / 1e9:.0f} GB of this machine; take fewer pings "
                         "or beams, a shorter range, or let shapes share an id")


def _memory():
    """Physical memory [bytes]; infinite where the system does not say."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return np.inf


def _origin(scene):
    """Easting and northing of the scene's origin and their coordinate system, from the first shape that knows them."""
    return next(((np.asarray(shape.local_origin, float)[:2], getattr(shape, "crs", None) or "")
                 for shape in scene.shapes() if getattr(shape, "local_origin", None) is not None), (None, ""))


mi.register_integrator("sonar_path", SonarPath)
