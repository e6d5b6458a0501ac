"""Attributes of the pulse of a sonar with arrays, and the pulse that they describe."""
from mitsonar.sonar.arrays.shading import window_weights
from mitsonar.sonar.pulses.pulse import Pulse
from mitsonar.sonar.pulses.pulses import PULSES
from mitsonar.units import hertz_from_khz

from ..attributes import Attributes, Choice, Number, Text

WINDOW_SAMPLES = 64                # on which a pulse's window is tried

PULSE = (
    Choice("pulse", default="lfm", choices=tuple(PULSES), text="waveform: one frequency, or a sweep"),
    Number("pulse_ms", default=1.0, above=0, maximum=10_000, unit="ms", text="pulse length"),
    Number("bandwidth_khz", default=10.0, unit="kHz", text="bandwidth of a sweep"),
    Text("pulse_window", default=None, text='window over the pulse, such as "hann" or "tukey 0.1"'),
)


def read_pulse(attributes: Attributes, frequency: float, longer: float = 1.0) -> Pulse:       # frequency [Hz]
    """Make the pulse that attributes describe, or one that is longer and narrower by a factor."""
    return make_pulse(attributes, frequency, longer * attributes.pulse_ms / 1000,
                      float(hertz_from_khz(attributes.bandwidth_khz)) / longer, attributes.pulse_window)


def make_pulse(attributes: Attributes, frequency: float, duration: float, bandwidth: float,        # [Hz], [s], [Hz]
               window: str | None = None) -> Pulse:
    """Make a pulse of the waveform that the attribute `pulse` names."""
    arguments = {"frequency": frequency, "duration": duration}
    if attributes.pulse != "cw":
        arguments["bandwidth"] = bandwidth
    elif attributes.given("bandwidth_khz"):
        raise attributes.error("bandwidth_khz is given, but a cw pulse has the bandwidth of its length; leave it out, "
                               "or make the pulse lfm or hfm.")
    try:
        return PULSES[attributes.pulse](**arguments, window=None if window is None else _window(window))
    except ValueError as error:
        raise attributes.error(error) from None


def _window(text):
    """Return a window as SciPy takes it, by name or by name and numbers, after the check that shading makes."""
    window_weights(text, WINDOW_SAMPLES)
    name, *numbers = text.split()
    return (name, *map(float, numbers)) if numbers else name
