"""Errors of the motion sensors of sounding sonars, and the depths in which they search for the bed."""
from mitsonar.hydrography.reduction.motion_errors import MotionErrors

from ..attributes import Angle, Attributes, Group, Number, Numbers

ARMS = ("antenna", "antenna_error", "motion_sensor", "motion_sensor_error", "offset_error")
FARTHEST = 500.0                   # [m]: no vessel is longer


def _arm(name: str, text: str) -> Numbers:
    return Numbers(name, default=(0.0, 0.0, 0.0), count=3, unit="m", text=text)


MOTION_ERRORS = Group(title="Motion sensor errors", module="sensors.motion_errors", attributes=(
    Angle("roll_bias_deg", default=0.0, minimum=-10, maximum=10,
          text="roll offset: by how much the assumed roll, of the sensor or the head's mounting, exceeds the true one"),
    Angle("pitch_bias_deg", default=0.0, minimum=-10, maximum=10, text="pitch offset, likewise"),
    Angle("heading_bias_deg", default=0.0, minimum=-10, maximum=10, text="heading offset, likewise"),
    Number("latency_ms", default=0.0, minimum=-1000, maximum=1000, unit="ms", text="age of the attitude and heave"),
    Number("position_latency_ms", default=0.0, minimum=-5000, maximum=5000, unit="ms",
           text="age of the position, and of the height above the ellipsoid"),
    Angle("attitude_noise_deg", default=0.0, minimum=0, maximum=5, text="rms noise of roll and pitch"),
    Angle("heading_noise_deg", default=0.0, minimum=0, maximum=10, text="rms noise of the heading"),
    Number("draft_error", default=0.0, minimum=-5, maximum=5, unit="m",
           text="by how much the assumed draft exceeds the true one"),
    Number("heave_noise", default=0.0, minimum=0, maximum=5, unit="m", text="rms noise of the heave"),
    Number("position_noise", default=0.0, minimum=0, maximum=50, unit="m", text="rms noise of x and of y"),
    Number("height_noise", default=0.0, minimum=0, maximum=5, unit="m", text="rms noise of ellipsoid heights"),
    Number("noise_correlation", default=5.0, above=0, maximum=1000, unit="s", text="correlation time of these noises"),
    _arm("antenna", '"forward, starboard, down" of the satellite antenna from the reference point'),
    _arm("antenna_error", "by how much the stated `antenna` differs from the true one"),
    _arm("motion_sensor", "the same of the sensor of heave, roll and pitch"),
    _arm("motion_sensor_error", "by how much the stated `motion_sensor` differs from the true one: the heave is "
                                "carried to the reference point by that arm"),
    _arm("offset_error", "by how much the stated `offset` of the arrays differs from the true one"),
    Number("tide_error", default=0.0, minimum=-20, maximum=20, unit="m",
           text="by how much the tide in use exceeds the true one"),
    Number("separation_error", default=0.0, minimum=-20, maximum=20, unit="m",
           text="by how much the separation in use exceeds the true one"),
))

DEPTH_GATE = Numbers("depth_gate", default=None, count=2, unit="m",
                     text='"from, to": depths below the sonar in which the bed is searched for')


def motion_errors(attributes: Attributes) -> MotionErrors:
    """Read the errors of the motion sensors."""
    arms = {name: tuple(float(part) for part in getattr(attributes, name)) for name in ARMS}
    if far := [name for name, arm in arms.items() if max(map(abs, arm)) > FARTHEST]:
        raise attributes.error(f"{far[0]} is {', '.join(f'{part:g}' for part in arms[far[0]])} m; give a lever arm "
                               f"within {FARTHEST:g} m.")
    return MotionErrors(
        roll_bias=attributes.roll_bias_deg, pitch_bias=attributes.pitch_bias_deg,
        heading_bias=attributes.heading_bias_deg, latency=attributes.latency_ms / 1000,
        attitude_noise=attributes.attitude_noise_deg, heading_noise=attributes.heading_noise_deg,
        draft_error=attributes.draft_error, heave_noise=attributes.heave_noise,
        position_noise=attributes.position_noise, correlation=attributes.noise_correlation,
        position_latency=attributes.position_latency_ms / 1000, height_noise=attributes.height_noise,
        tide_error=attributes.tide_error, separation_error=attributes.separation_error, **arms)


def depth_gate(attributes: Attributes) -> tuple[float, float] | None:
    """Read the depths [m] in which the bed is searched for; None for all."""
    gate = attributes.depth_gate
    if gate is None:
        return None
    if not 0 <= gate[0] < gate[1]:
        raise attributes.error(f"depth_gate is {gate[0]:g} to {gate[1]:g} m; the first must be 0 or more, and less "
                               "than the second.")
    return float(gate[0]), float(gate[1])
