"""The pulse of a sonar with arrays: its attributes, and the pulse that they describe."""
from mitsonar.sonar.arrays.shading import window_weights
from mitsonar.sonar.pulses.pulse import Pulse
from mitsonar.sonar.pulses.pulses import PULSES
from mitsonar.units import hertz_from_khz

from ..attributes import Attributes, Choice, Number, Text

WINDOW_SAMPLES = 64                # on which a pulse's window is tried

PULSE = (
    Choice("pulse", default="lfm", choices=tuple(PULSES), text="of one frequency, or a sweep"),
    Number("pulse_ms", default=1.0, above=0, maximum=10_000, unit="ms", text="its length"),
    Number("bandwidth_khz", default=10.0, unit="kHz", text="of a sweep"),
    Text("pulse_window", default=None, text='window over the pulse, as "hann" or "tukey 0.1"'),
)


def read_pulse(attributes: Attributes, frequency: float, longer: float = 1.0) -> Pulse:
    """Make the pulse that attributes describe."""
    # frequency [Hz]
    arguments = {"frequency": frequency, "duration": longer * attributes.pulse_ms / 1000}
    if attributes.pulse != "cw":
        arguments["bandwidth"] = float(hertz_from_khz(attributes.bandwidth_khz)) / longer
    elif attributes.given("bandwidth_khz"):
        raise attributes.error("bandwidth_khz is given, but a cw pulse has that of its length; leave it out, or make "
                               "the pulse lfm or hfm.")
    window = attributes.pulse_window
    try:
        return PULSES[attributes.pulse](**arguments, window=None if window is None else _window(window))
    except ValueError as error:
        raise attributes.error(error) from None


def _window(text):
    """A window's name, or its name and numbers, as SciPy takes them; what shading would refuse is refused here too."""
    window_weights(text, WINDOW_SAMPLES)
    name, *numbers = text.split()
    return (name, *map(float, numbers)) if numbers else name
