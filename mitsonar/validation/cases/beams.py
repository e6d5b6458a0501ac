"""Beams: patterns and directivity of lines, pistons and shaded arrays against closed forms."""
from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize_scalar
from scipy.special import j1

from mitsonar.sonar.arrays.array_makers import element_array, line_array
from mitsonar.sonar.arrays.beam_patterns import beam_pattern, directivity_index_db
from mitsonar.sonar.arrays.shading import taper_loss_db, window_weights
from mitsonar.sonar.faces.directivity import Aperture

from ..case import Case, Compared, Curve, Panel, Table, root_of, worst

SPEED, WAVELENGTH = 1500.0, 0.015
WINDOWS = {  # of 16 elements: highest side lobe [dB], full -3 dB width in (d/λ) sin ψ, taper loss [dB]
    "chebwin 30": (-30.0, 0.069582, -0.6468), "taylor 4 30": (-30.06, 0.070350, -0.6885),
    "hann": (-31.50, 0.096043, -2.0412), "hamming": (-39.37, 0.084883, -1.5440)}
LINES = {(16, 0.5): 12.041200, (16, 0.25): 9.117833, (64, 0.5): 18.061800, (10, 0.8): 11.857444}
PISTONS = {1: 3.733772, 5: 14.017325, 10: 20.029123}       # ka -> directivity index [dB], hard baffle
RECTANGLES = {(20, 20): 37.0160, (50, 0.5): 24.712}        # sides in wavelengths


def db(pressure: npt.ArrayLike) -> np.ndarray:
    """Return a pressure ratio in decibels."""
    return 20 * np.log10(np.abs(pressure))


def _towards(sine):
    """Return directions to starboard of straight down, from the sine of the angle."""
    sine = np.asarray(sine, float)
    return np.stack([0 * sine, sine, np.sqrt(1 - sine ** 2)], -1)


def _continuous():
    line = Aperture(length=100 * WAVELENGTH)
    lobe = float(db(line.along(4.493409 / (100 * np.pi), WAVELENGTH)))
    yield Compared("line: first side lobe", lobe, -13.261459, 1e-5, "dB")
    half = root_of(lambda u: line.along(u, WAVELENGTH) ** 2 - 0.5, 1e-4, 8e-3)
    yield Compared("line: full -3 dB width times L/λ", 200 * half, 0.88589294, 1e-6, "rad")
    half = root_of(lambda u: line.along(u, WAVELENGTH) ** 4 - 0.5, 1e-4, 8e-3)
    yield Compared("line, two-way: full -3 dB width times L/λ", 200 * half, 0.63783340, 1e-6, "rad")
    piston = _piston(30.0)

    def circle(sine: float) -> float:
        return float(db(beam_pattern(piston, _towards(sine), WAVELENGTH)))

    lobe: Any = minimize_scalar(lambda sine: -circle(sine), bounds=(4.2 / 30, 6.5 / 30), method="bounded",
                           options={"xatol": 1e-7})
    yield Compared("circular piston, ka 30: first side lobe", -lobe.fun, -17.570150, 1e-5, "dB")
    yield Compared("circular piston, ka 30: -3 dB at ka sin ψ =",
              30 * root_of(lambda sine: circle(sine) + 10 * np.log10(2), 0.01, 0.1), 1.61633995, 1e-6, "-")


def _piston(ka):
    return element_array([[0, 0, 0]], length=ka * WAVELENGTH / np.pi, pattern="circular", baffle="hard")


def _discrete():
    for elements, degrees, expected in ((16, 5, -8.570309), (16, 20, -20.912533), (64, 1, -5.029421)):
        line = line_array(elements, WAVELENGTH / 2)
        got = db(beam_pattern(line, _towards(np.sin(np.radians(degrees))), WAVELENGTH))
        yield Compared(f"line of {elements}, half a wavelength, {degrees} degrees off", float(got), expected, 1e-6,
                       "dB")
    line = line_array(16, 0.75 * WAVELENGTH).steered(_towards(0.5), SPEED)
    sine = np.sin(np.radians(-56.44269))
    yield Compared("grating lobe of 0.75 wavelengths steered to 30 degrees",
              float(db(beam_pattern(line, _towards(sine), WAVELENGTH, SPEED))), 0.0, 1e-5, "dB")


def _shaded():
    sine = np.linspace(0, 1, 20001)
    for window, (lobe, width, loss) in WINDOWS.items():
        line = line_array(16, WAVELENGTH / 2).shaded(window)
        level = db(beam_pattern(line, _towards(sine), WAVELENGTH))
        beyond = np.flatnonzero(np.diff(level) > 0)[0]
        yield Compared(f"{window}: highest side lobe", float(level[beyond:].max()), lobe, 0.01, "dB")
        edge = root_of(lambda sine, line=line: float(db(beam_pattern(line, _towards(sine), WAVELENGTH)))
                       + 10 * np.log10(2), 0, 0.3)
        yield Compared(f"{window}: full -3 dB width in (d/λ) sin ψ", edge, width, 2e-6, "-")
        yield Compared(f"{window}: taper loss", float(taper_loss_db(window_weights(window, 16))), loss, 1e-4, "dB")


def _gains():
    down = np.array([0.0, 0.0, 1.0])
    for (elements, pitch), expected in LINES.items():
        got = directivity_index_db(line_array(elements, pitch * WAVELENGTH), down, WAVELENGTH)
        yield Compared(f"directivity, {elements} omnidirectional at {pitch:g} wavelengths", got, expected, 1e-5, "dB")
    got = [directivity_index_db(_piston(ka), down, WAVELENGTH) for ka in PISTONS]
    yield worst("directivity of circular pistons, ka 1 to 10", got, list(PISTONS.values()), 1e-4, "dB")
    for (length, height), expected in RECTANGLES.items():
        face = element_array([[0, 0, 0]], length=length * WAVELENGTH, height=height * WAVELENGTH,
                             pattern="rectangular", baffle="hard")
        yield Compared(f"directivity of a face of {length:g} x {height:g} wavelengths",
                  directivity_index_db(face, down, WAVELENGTH), expected, 1e-3, "dB")


def _run(quick):
    sine = np.linspace(-1, 1, 1201)
    degrees = np.degrees(np.arcsin(sine))
    u = 0.5 * np.pi * sine
    safe = np.where(np.abs(u) < 1e-9, 1e-9, u)
    closed = np.sin(16 * safe) / (16 * np.sin(safe))
    plain = beam_pattern(line_array(16, WAVELENGTH / 2), _towards(sine), WAVELENGTH)
    x = np.where(sine == 0, 1e-9, 30 * sine)
    circle = beam_pattern(_piston(30.0), _towards(sine), WAVELENGTH)
    rows = (*_continuous(), *_discrete(),
            worst("line of 16 against |sin Nu/(N sin u)|", np.abs(plain), np.abs(closed), 1e-12, "-"),
            worst("circular piston against 2 J1(x)/x", np.abs(circle), np.abs(2 * j1(x) / x), 1e-9, "-"),
            *_shaded(), *_gains())
    shaded = [Curve(window, degrees, np.maximum(db(beam_pattern(
        line_array(16, WAVELENGTH / 2).shaded(window), _towards(sine), WAVELENGTH)), -60)) for window in WINDOWS]
    floor = 1e-3
    return Table(rows, (
        Panel("line of 16 elements", "angle [deg]", "dB", (
            Curve("closed form", degrees, db(np.maximum(np.abs(closed), floor))),
            Curve("computed", degrees[::6], db(np.maximum(np.abs(plain), floor))[::6], "."))),
        Panel("circular piston, ka 30", "angle [deg]", "dB", (
            Curve("closed form", degrees, db(np.maximum(np.abs(2 * j1(x) / x), floor))),
            Curve("computed", degrees[::6], db(np.maximum(np.abs(circle), floor))[::6], "."))),
        Panel("windows over 16 elements", "angle [deg]", "dB", tuple(shaded))))


CASE = Case(title="Beam patterns and directivity", run=_run, text=(
    "Continuous lines sin x/x, pistons 2 J₁(x)/x, lines of elements |sin Nu/(N sin u)|, windows over 16 elements "
    "(measured once by other means), directivity indices by closed sums and quadrature (Van Trees 2002; Urick 1983). "
    "The allowed error is the last digit of the numbers. Side lobes of windows are found on a grid. The quick run is "
    "the same."))
