"""Small scenes of every kind of sonar that differ in numbers alone, all of which are drawn by chance.

Each has a bed, a box that sticks in it, a point target and water of a profile, volume scattering and noise; the sonar
moves. Every number of a kind is drawn afresh, within spans that leave the ways of computing as they are: no ray turns,
all boxes lie partly under the bed, and all have shadows.
"""
import mitsuba as mi
import numpy as np
import sonar_scenes as scenes

SONAR = {"source_level_db": (195, 215), "speed_knots": (2.5, 4), "heading_deg": (0, 5), "roll_deg": (0.1, 1),
         "pitch_deg": (0.1, 0.4), "yaw_deg": (0.1, 0.4), "heave": (0.005, 0.02), "surge": (0.005, 0.02),
         "sway": (0.005, 0.02), "motion_period": (3, 9), "noise_level_db": (20, 40), "self_noise_db": (20, 40)}
VARIATION = {"patchiness": (1, 9), "patch_size": (2, 3), "glints": (1, 90), "glint_share": (0.1, 0.9), "weed_cover":
             (0.1, 0.4), "weed_db": (-5, 5), "weed_size": (2, 5), "weed_edge": (0.1, 0.9), "weed_heading_deg": (1, 90)}
PULSE = {"pulse_ms": (0.2, 0.5), "bandwidth_khz": (10, 25)}
OWN = {
    "sidescan": {
        "frequency_khz": (90, 500), "pulse_ms": (0.02, 0.1), "beam_width_deg": (0.5, 1.5), "depression_deg": (10, 30),
        "vertical_beam_width_deg": (40, 60), "receive_beam_width_deg": (0.5, 1.5), "vertical_sag": (0.1, 1),
        "sidelobe_db": (-40, -20), "vertical_sidelobe_db": (-30, -15), "back_db": (-40, -25), "chirp_ms": (1, 10),
        "crosstalk_db": (-60, -40),
        "yaw_jitter_deg": (0.05, 0.1), "phase_jitter_deg": (5, 20)},
    "forward_looking": {
        **PULSE, "frequency_khz": (200, 400), "fan_deg": (70, 120), "tilt_deg": (5, 30), "receive_jitter": (1e-5, 2e-5),
        "vertical_beam_width_deg": (40, 60), "transmit_beam_width_deg": (60, 150), "element_spacing": (0.4, 0.7),
        "vertical_sidelobe_db": (-30, -20), "receive_flaws": (0.1, 0.3)},
    "sector_scan": {
        "frequency_khz": (500, 800), "pulse_ms": (0.05, 0.2), "bandwidth_khz": (10, 50), "beam_width_deg": (2, 6),
        "vertical_beam_width_deg": (15, 40), "tilt_deg": (10, 40), "step_deg": (0.5, 2),
        "first_bearing_deg": (-30, 30), "vertical_sidelobe_db": (-30, -20)},
    "multibeam": {
        **PULSE, "frequency_khz": (200, 400), "swath_deg": (80, 120), "transmit_beam_width_deg": (2, 5),
        "receive_beam_width_deg": (2, 5), "receive_along_width_deg": (20, 40), "receive_flaws": (0.01, 0.2),
        "element_spacing": (0.4, 0.6), "head_speed_error": (-2, 2), "roll_bias_deg": (-1, 1),
        "swath_middle_deg": (-10, 10), "latency_ms": (-5, 5)},
    "interferometric": {
        "frequency_khz": (200, 400), "pulse_ms": (0.3, 0.6), "bandwidth_khz": (10, 20), "beam_width_deg": (0.5, 2),
        "vertical_beam_width_deg": (40, 80), "row_vertical_width_deg": (80, 140), "tilt_deg": (20, 50),
        "looks": (4, 10)},
    "synthetic_aperture": {
        "frequency_khz": (200, 320), "pulse_ms": (2, 2.5), "bandwidth_khz": (20, 40), "depression_deg": (15, 25),
        "receiver_length": (0.04, 0.06), "transmitter_length": (0.04, 0.06), "vertical_beam_width_deg": (30, 50),
        "transmitter_forward": (0.05, 0.1), "speed_knots": (3.5, 4)},
    "echo_sounder": {
        "frequency_khz": (100, 150), "pulse_ms": (0.2, 0.3), "beam_width_deg": (8, 20), "bottom_level_db": (-60, -50)},
    "array_sonar": {
        "frequency_khz": (80, 150), "pulse_ms": (0.3, 1), "bandwidth_khz": (5, 15), "fan_deg": (60, 120),
        "receive_pitch": (0.004, 0.01), "receive_element_length": (0.002, 0.008), "receive_jitter": (1e-5, 2e-5),
        "transmit_element_height": (0.01, 0.05), "receive_flaws": (0.1, 0.3)},
}
KINDS = tuple(OWN)
SIZES = {                           # sensor, film, integrator: what kernels may depend upon
    "sidescan": ({"speckle": True, "recorder": "sidescan_16bit"}, {"bins": 60}, {"rays": 2000}),
    "forward_looking": ({"receive_elements": 6, "beams": 9}, {}, {}),
    "sector_scan": ({"sector_deg": 30.0, "pings": 2}, {"bins": 200}, {"rays": 1000}),
    "multibeam": ({"beams": 12, "pulse": "lfm"}, {}, {}),
    "interferometric": ({}, {"bins": 40}, {}),
    "synthetic_aperture": ({"receivers": 6, "pings": 3, "image_spacing": 0.04}, {}, {"rays": 1000}),
    "echo_sounder": ({"depth_gate": "2, 15"}, {"bins": 200}, {"rays": 1000}),
    "array_sonar": ({"receive": "line", "receive_elements": 6, "beams": 9}, {}, {}),
}

def numbered(kind, rng, **written):
    """Draw a scene of a kind of sonar; `written` are attributes of the sensor that are not drawn."""
    def drawn(low, high):
        return float(rng.uniform(low, high))

    sensor, film, integrator = (dict(some) for some in SIZES[kind])
    sensor = {"noise": True, "pings": 1, **sensor, "motion_seed": int(rng.integers(100)),
              **{name: drawn(*span) for name, span in {**SONAR, **OWN[kind]}.items()}}
    depth, bed, size, far = drawn(5, 6), drawn(10, 11), drawn(0.8, 1.4), drawn(18, 22)
    across = kind in ("sidescan", "interferometric", "synthetic_aperture")
    place = [far - 3.0 if kind == "synthetic_aperture" else drawn(3, 6), drawn(-0.5, 0.5) if across else drawn(3, 6)]
    if kind == "forward_looking":                          # the box and its shadow lie in every lobe
        place = [place[0] - 3.0, place[1] + 3.0]
    sensor |= {"start": [drawn(-1, 1), drawn(-1, 1), -depth], "offset": f"{drawn(-0.2, 0.2)}, {drawn(0, 0.2)}, 0.1"}
    film["range"] = far
    if kind != "sidescan":
        integrator["cell"] = drawn(0.25, 0.35)
    if kind in ("forward_looking", "array_sonar", "synthetic_aperture"):
        film["range_min"] = drawn(5, 6) if kind != "synthetic_aperture" else far - 4
    if kind == "multibeam":
        sectors = "frequency_khz", "pulse_ms", "bandwidth_khz", "source_level_db"
        sensor |= {name: str(sensor[name]) for name in sectors}
        sensor |= {"receive_place": f"{drawn(0.02, 0.1)}, 0.02, 0.01"}
    if kind == "interferometric":
        sensor["rows"] = f"0, {drawn(0.4, 0.55)}, 1.5, 4"
    speed = drawn(1480, 1520)
    water = {"profile": f"0:{speed}, {drawn(8, 12)}:{speed - drawn(0.5, 2)}, 30:{speed - drawn(2.5, 4)}",
             "volume_strength_db": drawn(-80, -60), "absorption_db_per_km": drawn(20, 60), "ph": drawn(7.5, 8.2)}
    if kind == "synthetic_aperture":                       # close to the array, delays are found in two ways
        del water["volume_strength_db"]
    sensor |= written
    to_world = mi.ScalarTransform4f().translate([*place, -bed]).scale([size] * 3)
    # by a generator of its own: all other numbers stay
    own = np.random.default_rng(int(1e6 * bed))
    ground = {**scenes.lambert(drawn(-30, -20)), **{name: own.uniform(*span) for name, span in VARIATION.items()}}
    shapes = {"seabed": scenes.bed(bed, ground, size=60.0, tilt=drawn(-0.02, 0.02)),
              "box": {"type": "cube", "to_world": to_world, "bsdf": scenes.lambert(drawn(-20, -10))},
              "ball": scenes.point_target([place[0], 2.0, 1 - bed], drawn(-20, 0))}
    return getattr(scenes, kind)(shapes, depth=depth, sensor=sensor, water=water, film=film, integrator=integrator)
