"""Points of the water in the beam domain: their legs come from a table, and rays are traced only where needed.

Geometry: a level bed 30 m deep under a summer's thermocline, a box of 6 m on it, and a swath that looks down from 2 m.
Closed form: none; every point is connected once more along its exact eigenray, with a shadow ray of its own.
Tolerance: a bilinear table of 192 x 64 nodes smooths the kinks of the profile, by less than 0.1 dB rms on both ways and
0.05 degrees. Speckle is 5.6 dB and the narrowest beam 0.4 degrees, so that neither can be seen. Hidden are the same
points but for those within 8 mm of the edge of a shadow: 1e-4 of all.
"""
import mitsuba as mi
import numpy as np
from sonar_scenes import bed, multibeam
from summer import SUMMER_TEXT

from mitsonar.echoes.sonar_equation import leg_gain, speed_ratio
from mitsonar.survey.multibeam.beams import sector_beams


def test_points_of_the_water_are_as_loud_and_as_hidden_as_their_own_rays_say(variant):
    box = {"type": "cube", "to_world": mi.ScalarTransform4f().translate([8, 0, -27]).scale(3),
           "bsdf": {"type": "lambert"}}
    scene = multibeam({"seabed": bed(30.0), "box": box}, depth=2.0,
                      water={"profile": SUMMER_TEXT, "volume_strength_db": -70.0})
    echoes = sector_beams(scene.integrator().survey(scene, scene.sensors()[0]))[0].echoes
    origin, reception = echoes.survey.track.position[0], echoes.reception(0)
    points = echoes._water.around(origin, *echoes._lobe_rays.draw(reception.rotation, 0.0, 7), 7)
    ensonification = echoes.ground.ensonification
    sources, start = ensonification._source(origin)
    place = start + points.out_offset
    way = ensonification.connector.connect_in_water(sources, start, place)
    ratio = speed_ratio(way.sound_speed, sources.state.gather(ensonification.lib, mi.UInt32(0))[1])
    gain = leg_gain(spreading_area=way.spreading_area, speed_ratio=ratio,
                    loss_db=ensonification.water.loss_db(start, place, way)).numpy()
    table = echoes._water._table.legs(points.out_offset)
    both = way.exists.numpy() & table.exists.numpy()
    assert both.sum() > 0.99 * way.exists.numpy().sum() > 10_000
    level = 20 * np.log10(table.gain.numpy()[both] / gain[both])
    assert np.sqrt(np.mean(level ** 2)) < 0.1 and abs(level.mean()) < 0.02
    turn = np.linalg.norm(points.sent.numpy() - way.launch_direction.numpy(), axis=0)[both]
    assert np.degrees(np.sqrt(np.mean(turn ** 2))) < 0.05
    late = points.out_time.numpy() - way.travel_time.numpy()
    assert np.abs(late[both]).max() * echoes.survey.sampling_rate < 1
    hidden, behind = points.state.numpy() != 0, ~way.free.numpy()
    assert behind[both].sum() > 100 and (hidden != behind)[both].mean() < 1e-4
