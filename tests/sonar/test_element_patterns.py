"""Patterns of single elements against closed forms.

Circular piston 2 J1(X)/X: -3.0103 dB at X = 1.61633995, zero at 3.83170597, first side lobe -17.570150 dB at 5.135622,
two-way half power at 1.16028601. Directivity index of a piston in a rigid baffle (ka)²/(1 - J1(2ka)/ka), of rectangles
by quadrature in two directions (34.0521 dB for 100 x 2 wavelengths, 24.712 dB for 50 x 0.5). Tolerances are half a unit
of the last printed digit. On the device, float32: 1e-6 for the piston (measured 3e-7), 1e-5 for whole faces, whose
cosines are multiplied by π L/λ = 65 in the test.
"""
import drjit as dr
import numpy as np
import pytest
from drjit.auto import Array3f, Float

from mitsonar.sonar import directivity_index_db, element_array
from mitsonar.sonar.arrays.element_patterns import BAFFLES, PATTERNS, element_pressure, piston

DOWN = {"normal": [0.0, 0.0, 1.0], "along": [1.0, 0.0, 0.0]}
ROUNDING = 1e-12


def db(amplitude):
    return 20 * np.log10(np.abs(amplitude))


def directions(rng, count=4000):
    vectors = rng.standard_normal((count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def test_piston():
    assert piston(0.0) == 1 and piston(1e-7) == pytest.approx(1, abs=ROUNDING)
    assert db(piston(1.61633995)) == pytest.approx(-3.0103, abs=5e-5)
    assert piston(3.83170597) == pytest.approx(0, abs=5e-9)
    assert db(piston(5.135622)) == pytest.approx(-17.570150, abs=5e-7)
    assert piston(1.16028601) ** 4 == pytest.approx(0.5, abs=1e-8)


def test_circle_by_its_diameter():
    """ka = π D/λ; at the angle ψ of X = ka sin ψ, in any azimuth."""
    diameter, wavelength = 0.3, 0.03
    sine = 5.135622 / (np.pi * diameter / wavelength)
    azimuth = np.linspace(0, 2 * np.pi, 7)
    towards = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.full(7, np.sqrt(1 - sine ** 2))], axis=-1)
    found = element_pressure(towards, wavelength, **DOWN, length=diameter, pattern="circular")
    np.testing.assert_allclose(db(found), -17.570150, atol=5e-7)


def test_rectangle_is_a_product_of_lines(rng):
    """Length lies along ``along``: u = x, height across: v = y."""
    towards = directions(rng)
    found = element_pressure(towards, 0.015, **DOWN, length=0.1, height=0.03, pattern="rectangular")
    np.testing.assert_allclose(found, np.sinc(towards[:, 0] * 0.1 / 0.015) * np.sinc(towards[:, 1] * 0.03 / 0.015),
                               atol=ROUNDING)


def test_a_floor_fills_the_nulls_across_the_face_and_leaves_the_axis(rng):
    """b² = sinc²(L u/λ) ((1 - f) sinc²(H v/λ) + f), f = -20 dB; at v = λ/H, where sinc is 0, b = 0.1 and positive."""
    towards, face = directions(rng), {**DOWN, "length": 0.1, "height": 0.03, "floor": 0.01, "pattern": "rectangular"}
    u, v = np.sinc(towards[:, 0] * 0.1 / 0.015), np.sinc(towards[:, 1] * 0.03 / 0.015)
    np.testing.assert_allclose(element_pressure(towards, 0.015, **face) ** 2, u ** 2 * (0.99 * v ** 2 + 0.01),
                               atol=ROUNDING)
    axis, null = element_pressure(np.array([[0, 0, 1], [0, 0.5, 0.75 ** 0.5]]), 0.015, **face)
    assert axis == pytest.approx(1, abs=ROUNDING) and null == pytest.approx(0.1, abs=ROUNDING)
    for floor, pattern in ((1.0, "rectangular"), (-0.1, "rectangular"), (0.01, "omni")):
        with pytest.raises(ValueError, match=f"floor of side lobes of {pattern} elements is {floor:g}; give a power"):
            element_array([0.0, 0, 0], pattern=pattern, floor=floor)


@pytest.mark.parametrize("baffle", BAFFLES)
def test_baffles(baffle):
    """At 53.13 degrees from the normal (cosine 0.6), at 90 and at 126.87 degrees; 1 on the normal."""
    wanted = {"none": (1, 1, 1), "hard": (1, 1, 0), "soft": (0.6, 0, 0), "cardioid": (0.8, 0.5, 0.2)}[baffle]
    towards = np.array([[0.8, 0, 0.6], [1, 0, 0], [0.8, 0, -0.6]])
    np.testing.assert_allclose(element_pressure(towards, 0.015, **DOWN, baffle=baffle), wanted, atol=ROUNDING)
    assert element_pressure(np.array([0.0, 0, 1]), 0.015, **DOWN, baffle=baffle) == 1


@pytest.mark.parametrize(("pattern", "floor"), [*((name, 0.0) for name in PATTERNS), ("rectangular", 0.01)])
@pytest.mark.parametrize("baffle", BAFFLES)
def test_device_agrees(pattern, floor, baffle, rng):
    """In any attitude of the face; directions at the very edge of a baffle, where float32 tips over, are left out."""
    normal, other = directions(rng, 2)
    along = np.cross(normal, other) / np.linalg.norm(np.cross(normal, other))
    towards = directions(rng).astype(np.float32)
    towards = towards[np.abs(towards @ normal) > 1e-5]
    face = {"pattern": pattern, "baffle": baffle, "length": 0.31, "height": 0.0 if pattern == "circular" else 0.07,
            "floor": floor}
    wanted = element_pressure(towards.astype(float), 0.015, normal, along, **face)
    for vector in (Array3f(towards.T), tuple(Array3f(towards.T))):
        found = element_pressure(vector, 0.015, normal.tolist(), along.tolist(), **face)
        np.testing.assert_allclose(np.ravel(found), wanted, atol=1e-5)


def test_piston_on_the_device():
    x = np.linspace(0, 400, 100001).astype(np.float32)
    np.testing.assert_allclose(piston(Float(x)).numpy(), piston(x), atol=1e-6)


@pytest.mark.parametrize("pattern", PATTERNS)
def test_one_kernel_serves_faces_of_opaque_numbers(pattern, rng):
    towards = Array3f(directions(rng).astype(np.float32).T)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        for length in (0.1, 0.2):
            normal, along, size, wavelength = ([dr.opaque(Float, value) for value in values] for values in (
                (0, length, np.sqrt(1 - length ** 2)), (1, 0, 0), (length,), (0.1 * length,)))
            dr.eval(element_pressure(towards, *wavelength, normal, along, length=size[0], pattern=pattern,
                                     baffle="soft"))
        kernels = [kernel["hash"] for kernel in dr.kernel_history([dr.KernelType.JIT])]
    assert len(kernels) == 2 and len(set(kernels)) == 1


@pytest.mark.parametrize(("ka", "expected"), [(1, 3.733772), (5, 14.017325), (10, 20.029123), (50, 33.972704)])
def test_directivity_index_of_a_piston(ka, expected):
    face = element_array([0, 0, 0], pattern="circular", length=ka / np.pi, baffle="hard")
    assert directivity_index_db(face, [0, 0, 1], 1.0) == pytest.approx(expected, abs=5e-7)


@pytest.mark.parametrize(("length", "height", "expected", "half_digit"), [
    (100, 2, 34.0521, 5e-5), (50, 0.5, 24.712, 5e-4)])
def test_directivity_index_of_a_rectangle(length, height, expected, half_digit):
    face = element_array([0, 0, 0], pattern="rectangular", length=length, height=height, baffle="hard")
    assert directivity_index_db(face, [0, 0, 1], 1.0) == pytest.approx(expected, abs=half_digit)


@pytest.mark.parametrize(("baffle", "expected"), [("none", 1), ("hard", 2), ("soft", 6), ("cardioid", 3)])
def test_directivity_factor_of_baffles(baffle, expected):
    """4π/∫B² dΩ: 4π/4π, 4π/2π, 4π/(2π/3), 4π/(4π/3)."""
    face = element_array([0, 0, 0], baffle=baffle, normal="starboard")
    assert directivity_index_db(face, [0, 1, 0], 1.0) == pytest.approx(10 * np.log10(expected), abs=1e-10)
