"""Element signals on the device, read at the instant an echo from a point reaches each element.

    τ_n = (|P - T| + |P - R_n|) / c,     y = Σ_n w_n z_n(τ_n) exp(2πi f0 (τ_n - τ)) / Σ_n w_n

P -> point, T -> transmitter, R_n -> element n, τ -> the delay whose phase the result keeps. Only differences are made
in float32, against a whole sample and a phase that are exact:

    |P - R| - |P| = q / (|P - R| + |P|),   q = |R|² - 2 P·R                        (no cancellation)
"""
import importlib

import drjit as dr
import numpy as np

from mitsonar.propagation.device import arrays_of, upload

from .interpolation import MARGIN, corrected, interpolation_named

__all__ = ["ElementSignals", "device_arrays"]

TINY = 1e-12                       # [m], so that an element at its own focus divides by something


def device_arrays(like=None):
    """Dr.Jit namespace of `like` (array or type), or of the best backend that works here: CUDA, then LLVM."""
    if like is None:
        like = importlib.import_module("drjit.auto.ad").Float
    return arrays_of(like)


class ElementSignals:
    """Element signals of one ping, positions relative to `centre`.

    Parameters
    ----------
    lib : Dr.Jit namespace
    recording : Recording
    interpolation : str
        One of `INTERPOLATIONS`.
    weights : float64 (rx,)
        Adding to 1.
    """

    def __init__(self, lib, recording, interpolation, weights):
        self.lib, self.recording = lib, recording
        self.kernel = interpolation_named(interpolation)
        self.weights = weights.astype(np.float32)
        samples, elements = recording.values.shape[-1], recording.values.shape[2]
        self.elements = dr.opaque(lib.UInt32, elements)
        self.one = dr.opaque(lib.UInt32, 1)        # a literal step makes loop iterations wait for one another on x86
        self.row = dr.opaque(lib.UInt32, samples + 2 * MARGIN)
        self.earliest = dr.opaque(lib.Int32, -1 - self.kernel.first)
        self.latest = dr.opaque(lib.Int32, samples + 2 * MARGIN - 3)
        self.samples_per_metre = dr.opaque(lib.Float, recording.sampling_rate / recording.sound_speed)
        self.cycles_per_metre = dr.opaque(lib.Float, recording.frequency / recording.sound_speed)

    def load(self, ping, centre):
        """Bring a ping to the device; positions count from centre (3,) [m]."""
        lib, recording = self.lib, self.recording
        shaded = recording.values[ping] * self.weights[:, None]
        self.values = upload(lib.Float, corrected(self.kernel, shaded).view(np.float32))
        place = recording.receivers[ping] - centre
        table = np.column_stack([place, (place ** 2).sum(axis=1)])
        self.place = upload(lib.Float, table.astype(np.float32))
        dr.eval(self.values, self.place)

    def detour(self, point, distance, place):
        """|P - R| - |P| [m] of points (three Floats) at a distance |P| and elements (x, y, z, |R|²)."""
        q = dr.fma(-2 * point[0], place[0], dr.fma(-2 * point[1], place[1], dr.fma(-2 * point[2], place[2], place[3])))
        return q / dr.maximum(dr.sqrt(dr.maximum(dr.fma(distance, distance, q), 0)) + distance, TINY)

    def heard(self, row, element, point, distance, sample, fraction, phase):
        """Weighted signal (re, im) of elements at the instant an echo from the points reaches them.

        Parameters
        ----------
        row : UInt32
            tx number x elements + element.
        element : UInt32
        point : three Float [m]
        distance : Float [m]
            Their length.
        sample, fraction, phase : Int32, Float, Float [cycles]
            Whole and further samples, and the phase to be undone, of an element in the centre.
        """
        lib = self.lib
        further = self.detour(point, distance, dr.gather(lib.Array4f, self.place, element))
        turn = dr.fma(self.cycles_per_metre, further, phase)
        sin, cos = dr.sincos(2 * np.pi * (turn - dr.round(turn)))
        later = dr.fma(self.samples_per_metre, further, fraction)
        whole = dr.floor(later)
        index = dr.clip(sample + lib.Int32(whole) + MARGIN, self.earliest, self.latest) + self.kernel.first
        first = row * self.row + lib.UInt32(index)
        re, im = lib.Float(0), lib.Float(0)
        for k, tap in enumerate(self.kernel.taps(later - whole)):
            value = dr.gather(lib.Array2f, self.values, first + k)
            re, im = dr.fma(tap, value.x, re), dr.fma(tap, value.y, im)
        return dr.fma(re, cos, -im * sin), dr.fma(re, sin, im * cos)

    def add(self, tx, point, distance, sample, fraction, phase, total):
        """Add what all elements heard of transmitter number `tx` to total (re, im)."""
        offset = dr.opaque(self.lib.UInt32, tx * self.recording.values.shape[2])

        def body(n, re, im):
            a, b = self.heard(offset + n, n, point, distance, sample, fraction, phase)
            return n + self.one, re + a, im + b

        _, re, im = dr.while_loop((self.lib.UInt32(0), *total), lambda n, re, im: n < self.elements, body,
                                  mode="symbolic")
        dr.eval(re, im)
        return re, im
