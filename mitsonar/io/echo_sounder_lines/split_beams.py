"""Received power and directions of split beams.

    P = n |mean y|² / 8 · |Z_r + Z_t|² / Z_r² / Z_t               of the signals y [V] of n sectors
    P = 10 log10(2) / 256 · steps [dB]                            of samples that are power already

    φ = arg(y_fore y_aft*)                                        four quadrants
    φ_along = (α + β) / √3,  φ_athwart = β - α                    three sectors: α, β of fore to starboard and to port
    direction = φ / sensitivity - offset

Z_r, Z_t -> impedances of transceiver and transducer. Three sectors with an element in their middle are paired with it
(Andersen et al. 2024, Quantitative processing of broadband data as implemented in a scientific split-beam echosounder,
eqs. 5 to 10).
"""
import numpy as np

from mitsonar.units import db_from_power

STEP_DB = 10 * np.log10(2) / 256   # of a step of power
STEP = np.pi / 128                 # [rad] of a step of electrical angle
TRANSDUCER = 75.0                  # [ohm]
QUADRANTS, SECTORS, SECTORS_AND_MIDDLE = 1, 17, (49, 65, 81)     # types of beams


def power_db(signal: np.ndarray, receiver: float, transducer: float = TRANSDUCER) -> np.ndarray:
    """Return the received power (..., N) [dB re 1 W] of signals (..., sectors, N) [V]; -inf where it is 0."""
    mean = np.abs(signal.mean(-2, dtype=np.complex128))
    with np.errstate(divide="ignore"):
        return db_from_power(signal.shape[-2] * mean ** 2 / 8 * (abs(receiver + transducer) / receiver) ** 2
                             / transducer)


def electrical(signal: np.ndarray, beam: int) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the phases (..., N) [rad] along and athwart of signals (..., sectors, N); None: no split beam."""
    sectors = signal.shape[-2]
    if beam == QUADRANTS and sectors == 4:
        one, two, three, four = np.moveaxis(signal, -2, 0)
        return _phase(three + four, one + two), _phase(one + four, two + three)
    if beam == SECTORS and sectors == 3:
        starboard, port, fore = np.moveaxis(signal, -2, 0)
    elif beam in SECTORS_AND_MIDDLE and sectors == 4:
        starboard, port, fore = (signal[..., number, :] + signal[..., 3, :] for number in range(3))
    else:
        return None
    to_starboard, to_port = _phase(fore, starboard), _phase(fore, port)
    return (to_starboard + to_port) / np.sqrt(3), to_port - to_starboard


def _phase(one, other):
    """Return the phase [rad] by which one signal is ahead of another."""
    return np.angle(one * np.conj(other))
