"""What sounding sonars believe of their motion, and where they look for the bed: attributes that they share."""
from mitsonar.hydrography.reduction.motion_errors import MotionErrors

from ..attributes import Angle, Attributes, Group, Number, Numbers

MOTION_ERRORS = Group(title="What the motion sensors say", module="sensors.motion_errors", attributes=(
    Angle("roll_bias_deg", default=0.0, minimum=-10, maximum=10, text="that the roll sensor, or the head's mounting, "
                                                                      "is thought to be more than it is"),
    Angle("pitch_bias_deg", default=0.0, minimum=-10, maximum=10, text="likewise, pitch"),
    Angle("heading_bias_deg", default=0.0, minimum=-10, maximum=10, text="likewise, heading"),
    Number("latency_ms", default=0.0, minimum=-1000, maximum=1000, unit="ms", text="by which attitude and heave are "
                                                                                  "those of an earlier time"),
    Angle("attitude_noise_deg", default=0.0, minimum=0, maximum=5, text="of roll and pitch, root mean square"),
    Angle("heading_noise_deg", default=0.0, minimum=0, maximum=10, text="of the heading, likewise"),
    Number("heave_noise", default=0.0, minimum=0, maximum=5, unit="m", text="of the heave, likewise"),
    Number("position_noise", default=0.0, minimum=0, maximum=50, unit="m", text="of x and of y, likewise"),
    Number("noise_correlation", default=5.0, above=0, maximum=1000, unit="s", text="time over which these noises keep "
                                                                                  "about what they are"),
))

DEPTH_GATE = Numbers("depth_gate", default=None, count=2, unit="m",
                     text='"from, to" below the sonar, where the bed is looked for')


def motion_errors(attributes: Attributes) -> MotionErrors:
    """Read what the motion sensors say."""
    return MotionErrors(
        roll_bias=attributes.roll_bias_deg, pitch_bias=attributes.pitch_bias_deg,
        heading_bias=attributes.heading_bias_deg, latency=attributes.latency_ms / 1000,
        attitude_noise=attributes.attitude_noise_deg, heading_noise=attributes.heading_noise_deg,
        heave_noise=attributes.heave_noise, position_noise=attributes.position_noise,
        correlation=attributes.noise_correlation)


def depth_gate(attributes: Attributes) -> tuple[float, float] | None:
    """Read the depths [m] between which the bed is looked for; None for all."""
    gate = attributes.depth_gate
    if gate is None:
        return None
    if not 0 <= gate[0] < gate[1]:
        raise attributes.error(f"depth_gate is {gate[0]:g} to {gate[1]:g} m; the first must be 0 or more, and less "
                               "than the second.")
    return float(gate[0]), float(gate[1])
