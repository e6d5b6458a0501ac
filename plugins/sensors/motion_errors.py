"""Errors of the motion sensors of sounding sonars, and the depths in which they search for the bed."""
from mitsonar.hydrography.reduction.motion_errors import MotionErrors

from ..attributes import Angle, Attributes, Group, Number, Numbers

MOTION_ERRORS = Group(title="Motion sensor errors", module="sensors.motion_errors", attributes=(
    Angle("roll_bias_deg", default=0.0, minimum=-10, maximum=10,
          text="roll offset: by how much the assumed roll, of the sensor or the head's mounting, exceeds the true one"),
    Angle("pitch_bias_deg", default=0.0, minimum=-10, maximum=10, text="pitch offset, likewise"),
    Angle("heading_bias_deg", default=0.0, minimum=-10, maximum=10, text="heading offset, likewise"),
    Number("latency_ms", default=0.0, minimum=-1000, maximum=1000, unit="ms", text="age of the attitude and heave"),
    Angle("attitude_noise_deg", default=0.0, minimum=0, maximum=5, text="rms noise of roll and pitch"),
    Angle("heading_noise_deg", default=0.0, minimum=0, maximum=10, text="rms noise of the heading"),
    Number("draft_error", default=0.0, minimum=-5, maximum=5, unit="m",
           text="by how much the assumed draft exceeds the true one"),
    Number("heave_noise", default=0.0, minimum=0, maximum=5, unit="m", text="rms noise of the heave"),
    Number("position_noise", default=0.0, minimum=0, maximum=50, unit="m", text="rms noise of x and of y"),
    Number("noise_correlation", default=5.0, above=0, maximum=1000, unit="s", text="correlation time of these noises"),
))

DEPTH_GATE = Numbers("depth_gate", default=None, count=2, unit="m",
                     text='"from, to": depths below the sonar in which the bed is searched for')


def motion_errors(attributes: Attributes) -> MotionErrors:
    """Read the errors of the motion sensors."""
    return MotionErrors(
        roll_bias=attributes.roll_bias_deg, pitch_bias=attributes.pitch_bias_deg,
        heading_bias=attributes.heading_bias_deg, latency=attributes.latency_ms / 1000,
        attitude_noise=attributes.attitude_noise_deg, heading_noise=attributes.heading_noise_deg,
        draft_error=attributes.draft_error, heave_noise=attributes.heave_noise,
        position_noise=attributes.position_noise, correlation=attributes.noise_correlation)


def depth_gate(attributes: Attributes) -> tuple[float, float] | None:
    """Read the depths [m] in which the bed is searched for; None for all."""
    gate = attributes.depth_gate
    if gate is None:
        return None
    if not 0 <= gate[0] < gate[1]:
        raise attributes.error(f"depth_gate is {gate[0]:g} to {gate[1]:g} m; the first must be 0 or more, and less "
                               "than the second.")
    return float(gate[0]), float(gate[1])
