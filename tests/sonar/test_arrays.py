"""Arrays of elements: the makers, as one family; weights, delays and patterns against closed forms.

Uniform line of N at pitch d: |sin Nu/(N sin u)|, u = (πd/λ)(sin ψ - sin ψ0); directivity index
N²/(N + 2 Σ (N - m) sinc(2πmd/λ)). Windows over 16 elements: half weights, highest side lobe, -3 dB width in (d/λ) sin ψ
and taper loss, measured once and printed to the digits below. Phases of a focus: a point source's spherical waves.
Tolerances are half a unit of the last printed digit, else rounding of float64, 1e-12.
"""
import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from mitsonar.sonar import (
    Array,
    beam_pattern,
    body_direction,
    cylindrical_array,
    directivity_index_db,
    element_array,
    line_array,
    mills_cross,
    planar_array,
    spherical_array,
)
from mitsonar.sonar.arrays.axes import AXES
from mitsonar.sonar.arrays.shading import WINDOWS, taper_loss_db, window_weights

ROUNDING = 1e-12
SPEED, WAVELENGTH = 1500.0, 0.015

# name -> array, its number of elements, and of faces that look different ways
FAMILY = {
    "line": (lambda: line_array(7, 0.01), 7, 1),
    "oblique line": (lambda: line_array(4, 0.01, axis=(1, 2, 3), normal="forward"), 4, 1),
    "line of one": (lambda: line_array(1, 0.01), 1, 1),
    "end-fire line": (lambda: line_array(5, 0.01, axis="forward", normal="forward"), 5, 1),
    "plane": (lambda: planar_array(5, 3, 0.01, row_pitch=0.02), 15, 1),
    "leaning plane": (lambda: planar_array(4, 4, 0.01, normal=(1, 1, 1)), 16, 1),
    "cross, transmitting": (lambda: mills_cross(8, 16, 0.01)[0], 8, 1),
    "cross, receiving": (lambda: mills_cross(8, 16, 0.01)[1], 16, 1),
    "cylinder": (lambda: cylindrical_array(12, 0.3, rows=4), 48, 12),
    "arc": (lambda: cylindrical_array(9, 0.3, aperture=2.0, normal="starboard"), 9, 9),
    "sphere": (lambda: spherical_array(50, 0.2), 50, 50),
    "cap": (lambda: spherical_array(20, 0.2, aperture=1.5, normal=(0, 1, 1)), 20, 20),
    "list": (lambda: element_array([[0, 0, 0], [0.1, 0, 0], [0, 0.3, 0.1]], normal="aft").centred(), 3, 1),
}


def db(amplitude):
    return 20 * np.log10(np.abs(amplitude))


def athwart(sine):
    """Directions at an angle from straight down, towards starboard, by its sine."""
    sine = np.asarray(sine, dtype=float)
    return np.stack([np.zeros_like(sine), sine, np.sqrt(1 - sine ** 2)], axis=-1)


def two_halves(half):
    return [*half, *half[::-1]]


# ---- the family

@pytest.mark.parametrize("name", FAMILY)
def test_makers(name):
    make, elements, faces = FAMILY[name]
    array = make()
    assert array.elements == elements and array.position.shape == (elements, 3)
    np.testing.assert_allclose(array.position.mean(axis=0), 0, atol=ROUNDING)
    np.testing.assert_allclose(np.linalg.norm(array.normal, axis=1), 1, atol=ROUNDING)
    np.testing.assert_allclose(np.linalg.norm(array.along, axis=1), 1, atol=ROUNDING)
    np.testing.assert_allclose(np.sum(array.normal * array.along, axis=1), 0, atol=ROUNDING)
    assert array.weight.tolist() == [1] * elements and array.delay.tolist() == [0] * elements
    assert np.linalg.norm(array.position, axis=1).max() == array.radius
    grouped = array.faces()
    assert len(grouped) == faces
    assert sorted(np.concatenate([face.indices for face in grouped])) == list(range(elements))
    for face in grouped:
        np.testing.assert_allclose(array.normal[face.indices], np.tile(face.normal, (len(face.indices), 1)))
        np.testing.assert_allclose(array.along[face.indices], np.tile(face.along, (len(face.indices), 1)))


@pytest.mark.parametrize("name", FAMILY)
def test_changes_leave_the_rest_alone(name):
    """Each method changes its own field; weights and delays pile up."""
    array = FAMILY[name][0]()
    steered = array.steered("starboard", SPEED)
    np.testing.assert_allclose(steered.delay, array.position[:, 1] / SPEED, atol=1e-18)
    np.testing.assert_allclose(steered.steered("port", SPEED).delay, 0, atol=1e-18)
    assert np.array_equal(steered.position, array.position) and np.array_equal(steered.weight, array.weight)
    moved = array.moved([1, 2, 3])
    np.testing.assert_allclose(moved.position - array.position, np.tile([1, 2, 3], (array.elements, 1)), atol=1e-12)
    np.testing.assert_allclose(moved.centred().position, array.position, atol=ROUNDING)
    if array.elements > 1:
        broken = array.failing(0)
        assert broken.working.tolist() == [False] + [True] * (array.elements - 1)
        assert array.working.all()


def test_line_places():
    np.testing.assert_allclose(line_array(4, 0.5).position, [[0, -0.75, 0], [0, -0.25, 0], [0, 0.25, 0], [0, 0.75, 0]])
    assert np.array_equal(line_array(4, 0.5).along[0], AXES["starboard"])
    assert np.array_equal(line_array(4, 0.5, axis="down").normal[0], AXES["forward"])


def test_plane_is_numbered_as_one_reads():
    """Looking forward: along starboard first, then row by row down."""
    plane = planar_array(3, 2, 1.0, row_pitch=4.0, normal="forward")
    np.testing.assert_allclose(plane.position, [[0, y, z] for z in (-2, 2) for y in (-1, 0, 1)])


def test_cross_lines_are_perpendicular():
    transmit, receive = mills_cross(8, 16, 0.01, receive_pitch=0.02)
    assert (transmit.pitch(), receive.pitch()) == pytest.approx((0.01, 0.02))
    assert np.ptp(transmit.position, axis=0) == pytest.approx([0.07, 0, 0])
    assert np.ptp(receive.position, axis=0) == pytest.approx([0, 0.3, 0])


def test_cylinder_places():
    """Elements in the middle of equal parts, numbered from port to starboard, rows down."""
    ring = cylindrical_array(4, 2.0, rows=2, row_pitch=1.0)
    half = np.sqrt(2)
    circle = [[-half, -half], [half, -half], [half, half], [-half, half]]
    np.testing.assert_allclose(ring.position, [[x, y, z] for z in (-0.5, 0.5) for x, y in circle], atol=ROUNDING)
    np.testing.assert_allclose(ring.normal[:4, :2] * 2, circle, atol=ROUNDING)
    rows = cylindrical_array(6, 1.0, rows=3, aperture=np.pi).position.reshape(3, 6, 3)
    assert np.diff(rows[:, 0, 2]) == pytest.approx(np.pi / 6)                 # as along the arc, if not written


def test_sphere_is_covered_evenly():
    """Each octant holds an eighth of the elements within 2 %, and all have a neighbour about as far away."""
    ball = spherical_array(2000, 1.0)
    octant = (ball.normal > 0) @ [1, 2, 4]
    assert np.bincount(octant, minlength=8) == pytest.approx(np.full(8, 250), abs=5)
    gap = np.linalg.norm(ball.position[:, None] - ball.position, axis=2) + 9 * np.eye(2000)
    assert np.ptp(gap.min(axis=0)) < 0.35 * np.sqrt(4 * np.pi / 2000)
    cap = spherical_array(50, 1.0, aperture=np.pi / 2, normal="starboard")
    assert np.arccos(cap.normal[:, 1].min()) < np.pi / 4 < np.arccos(cap.normal[:, 1].min()) + 0.02


def test_body_direction():
    np.testing.assert_allclose(body_direction([0, np.pi / 2, 0], [0, 0, np.pi / 2]), np.eye(3), atol=ROUNDING)
    assert body_direction(np.pi / 2, np.pi / 6) == pytest.approx([0, np.sqrt(0.75), 0.5])


# ---- patterns

@pytest.mark.parametrize(("elements", "angle_deg", "expected_db"), [
    (16, 5, -8.570309), (16, 20, -20.912533), (64, 1, -5.029421)])
def test_uniform_line(elements, angle_deg, expected_db):
    line = line_array(elements, WAVELENGTH / 2)
    found = db(beam_pattern(line, athwart(np.sin(np.radians(angle_deg))), WAVELENGTH))
    assert found == pytest.approx(expected_db, abs=1e-6)


@pytest.mark.parametrize("pitch", [0.5, 0.8, 1.0])
def test_steered_line(pitch):
    """The closed form in sin ψ - sin ψ0, grating lobes included."""
    sine0, sine = np.sin(np.radians(30)), np.linspace(-0.999, 0.999, 2001)
    line = line_array(16, pitch * WAVELENGTH).steered(athwart(sine0), SPEED)
    u = np.pi * pitch * (sine - sine0)
    wanted = np.abs(np.sin(16 * u) / (16 * np.sin(u)))
    np.testing.assert_allclose(np.abs(beam_pattern(line, athwart(sine), WAVELENGTH, SPEED)), wanted, atol=1e-10)


def test_grating_lobe():
    """sin ψ_g = sin ψ0 + mλ/d: of 0.75 wavelengths and 30 degrees -56.44269 degrees, as loud as the main lobe."""
    line = line_array(32, 0.75 * WAVELENGTH).steered(athwart(0.5), SPEED)
    lobe = beam_pattern(line, athwart(np.sin(np.radians(-56.44269))), WAVELENGTH, SPEED)
    assert db(lobe) == pytest.approx(0, abs=1e-5)


def test_plane_is_a_product_of_lines(rng):
    plane = planar_array(8, 5, 0.5, row_pitch=0.7)
    towards = rng.standard_normal((200, 3))
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    lines = (beam_pattern(line_array(n, pitch, axis=axis), towards, 1.0)
             for n, pitch, axis in ((8, 0.5, "starboard"), (5, 0.7, "forward")))
    np.testing.assert_allclose(beam_pattern(plane, towards, 1.0), np.prod(list(lines), axis=0), atol=ROUNDING)


def test_cylinder_steered_adds_up_where_it_looks():
    """Phase to plane a cos(φ_n - φ0)/c: every element in phase towards φ0, whatever the face."""
    ring = cylindrical_array(24, 0.2, aperture=np.pi, pattern="rectangular", length=0.02, baffle="soft")
    towards = body_direction(0.3, 0.0)
    factor = np.mean([ring.element_pressure(towards, WAVELENGTH, face.normal, face.along) for face in ring.faces()])
    found = beam_pattern(ring.steered(towards, SPEED), towards, WAVELENGTH, SPEED)
    assert found == pytest.approx(factor, abs=1e-12)


@pytest.mark.parametrize(("elements", "pitch", "expected"), [
    (16, 0.5, 12.041200), (16, 0.25, 9.117833), (64, 0.5, 18.061800), (10, 0.8, 11.857444)])
def test_directivity_index_of_a_line(elements, pitch, expected):
    line = line_array(elements, pitch * WAVELENGTH)
    assert directivity_index_db(line, [0, 0, 1], WAVELENGTH) == pytest.approx(expected, abs=5.1e-7)
    # at half a wavelength the elements' noises are independent, however the line is steered
    if pitch == 0.5:
        towards = athwart(0.8)
        found = directivity_index_db(line.steered(towards, SPEED), towards, WAVELENGTH, SPEED)
        assert found == pytest.approx(10 * np.log10(elements), abs=1e-9)


def test_directivity_index_does_not_depend_on_the_place():
    line = line_array(8, 0.4 * WAVELENGTH)
    assert directivity_index_db(line.moved([0, 5, 0]), [0, 0, 1], WAVELENGTH) == pytest.approx(
        directivity_index_db(line, [0, 0, 1], WAVELENGTH), abs=1e-9)


# ---- shading

PRINTED = {
    ("chebwin", 30): ([.29098887, .31729619, .45568894, .60175601, .74238685, .86365970, .95278915, 1],
                      -30.000, 0.069582, -0.6468),
    ("taylor", 4, 30): ([.25388184, .32424441, .44634439, .59243322, .73678358, .86080731, .95170252, 1],
                        -30.055, 0.070350, -0.6885),
    "hann": ([0, .0437048, .16726224, .34930811, .55836504, .75828518, .91450051, 1], -31.50, 0.096043, -2.0412),
    "hamming": ([.08081233, .12098525, .23455772, .40189204, .59405459, .77781871, .92140993, 1],
                -39.37, 0.084883, -1.5440),
}


@pytest.mark.parametrize("window", PRINTED, ids=str)
def test_windows(window):
    half, side_lobe, width, loss = PRINTED[window]
    line = line_array(16, WAVELENGTH / 2).shaded(window)
    np.testing.assert_allclose(line.weight, two_halves(half), atol=1e-8)
    assert taper_loss_db(line.weight) == pytest.approx(loss, abs=5e-5)

    def level(sine):
        return db(beam_pattern(line, athwart(sine), WAVELENGTH))

    edge = brentq(lambda sine: level(sine) + 10 * np.log10(2), 1e-3, 0.2)
    assert edge == pytest.approx(width, abs=1e-6)        # the full width in (d/λ) sin ψ is 2 edge/2
    sine = np.linspace(0, 1, 4001)
    levels = level(sine)
    peaks = np.flatnonzero((levels[1:-1] > levels[:-2]) & (levels[1:-1] > levels[2:])) + 1
    top = peaks[np.argmax(levels[peaks])]
    found = minimize_scalar(lambda s: -level(s), bounds=(sine[top - 1], sine[top + 1]), method="bounded")
    assert -found.fun == pytest.approx(side_lobe, abs=5e-3)


@pytest.mark.parametrize("name", WINDOWS)
def test_every_window_is_symmetric_with_a_largest_weight_of_one(name):
    numbers = [2.5 if "beta" in number or "half" in number else 2 for number in WINDOWS[name] if "=" not in number]
    weights = window_weights((name, *numbers), 15)
    np.testing.assert_allclose(weights, weights[::-1], atol=1e-9)
    assert weights.max() == 1 and taper_loss_db(weights) <= 1e-9
    written = " ".join(map(str, (name, *numbers)))
    assert np.array_equal(window_weights(written, 15), weights)


def test_windows_along_and_across():
    along, across = window_weights("hann", 6), window_weights(("chebwin", 30), 4)
    plane = planar_array(6, 4, 0.1)
    np.testing.assert_allclose(plane.shaded("hann", "chebwin 30").weight.reshape(4, 6), np.outer(across, along))
    np.testing.assert_allclose(plane.shaded("hann").weight.reshape(4, 6), np.outer(window_weights("hann", 4), along))


# ---- failure, focus, jitter

def test_failed_elements():
    line = line_array(8, 0.1).shaded("hamming").failing([2, 5])
    assert np.flatnonzero(~line.working).tolist() == [2, 5]
    assert line.weight[[0, 1]] == pytest.approx(window_weights("hamming", 8)[:2])
    # 8 equal elements less one: its share is missing everywhere
    whole = line_array(8, WAVELENGTH / 2)
    found = 7 * beam_pattern(whole.failing(3), athwart([0.1, 0.7]), WAVELENGTH)
    lost = np.exp(2j * np.pi * athwart([0.1, 0.7]) @ whole.position[3] / WAVELENGTH)
    np.testing.assert_allclose(found, 8 * beam_pattern(whole, athwart([0.1, 0.7]), WAVELENGTH) - lost, atol=1e-10)


@pytest.mark.parametrize("name", FAMILY)
def test_focus(name):
    """What leaves each element after its delay arrives at the focus at the same time, |R|/c."""
    array, point = FAMILY[name][0](), np.array([0.3, 0.7, 1.1])
    arrival = array.focused(point, SPEED).delay + np.linalg.norm(point - array.position, axis=1) / SPEED
    np.testing.assert_allclose(arrival, np.linalg.norm(point) / SPEED, atol=1e-15)


def test_far_focus_is_steering():
    """To second order in r/R: |r|²/(2 R c) = 0.5²/(2e6 · 1500) s."""
    line = line_array(11, 0.1)
    far = line.focused(1e6 * body_direction(1.0, 0.5), SPEED).delay
    np.testing.assert_allclose(far, line.steered(body_direction(1.0, 0.5), SPEED).delay, atol=1e-10)


def test_jitter():
    """rms of 3000 Gaussian numbers within 4 standard errors, 5.2 %."""
    line = line_array(1000, 0.1)
    moved = line.jittered(2e-3, seed=7)
    assert np.std(moved.position - line.position) == pytest.approx(2e-3, rel=0.052)
    assert np.array_equal(moved.position, line.jittered(2e-3, seed=7).position)
    assert not np.array_equal(moved.position, line.jittered(2e-3, seed=8).position)


# ---- pitch

@pytest.mark.parametrize("axis", ["forward", "down", (1, 2, 3)])
def test_pitch_of_a_line(axis):
    assert line_array(9, 0.0075, axis=axis).moved([5, 5, 5]).pitch() == pytest.approx(0.0075, rel=1e-12)


@pytest.mark.parametrize(("array", "words"), [
    (line_array(1, 0.1), "a single element has no pitch"),
    (element_array([[0, 0, 0], [0, 0.1, 0], [0, 0, 0]]), "elements 0 and 2 are both at [0. 0. 0.]"),
    (element_array([[0, 0, 0], [0, 0.1, 0], [0, 0.3, 0]]), "element 1 is 0.05 m off its place at a pitch of 0.15 m"),
    (planar_array(3, 3, 0.1), "do not stand at one pitch on a line"),
    (line_array(8, 0.1).jittered(1e-3), "do not stand at one pitch on a line"),
])
def test_no_pitch(array, words):
    with pytest.raises(ValueError) as caught:
        array.pitch()
    assert words in str(caught.value)


# ---- refusals

@pytest.mark.parametrize(("make", "words"), [
    (lambda: element_array([]), "array: it has no elements; give at least one position"),
    (lambda: element_array([[0, 0]]), "position has shape (1, 2); give three coordinates"),
    (lambda: element_array("here"), "position must be numbers"),
    (lambda: element_array([[0, 0, np.nan]]), "position of element 0 is"),
    (lambda: element_array([[0, 0, 0]], normal=[[0, 0, 0]]), "normal of element 0 is [0, 0, 0]"),
    (lambda: element_array(np.zeros((2, 3)), normal=[[0, 0, 1]]), "normal is given for 1 elements of 2"),
    (lambda: element_array(np.zeros((2, 3)), weight=[1, 2, 3]), "weight has shape (3,), but 2 elements need (2,)"),
    (lambda: element_array(np.zeros((2, 3)), weight=0), "no element has a weight"),
    (lambda: element_array(np.zeros((2, 3)), delay=[0, np.inf]), "delay of element 1 is inf; give finite numbers"),
    (lambda: Array(position=[[0, 0, 0]], normal=[[0, 0, 1]], along=[[0, 1, 1]]), "it must be perpendicular"),
    (lambda: Array(position=[[0, 0, 0]], normal=[[0, 0, 0]], along=[[0, 1, 1]]), "normal of element 0 is [0. 0. 0.]"),
    (lambda: Array(position=[[0, 0, 0]], normal=[[0, 0, 1]], along=[[0, 1, 0]], layout=(2, 3)), "does not hold 1"),
    (lambda: line_array(0, 0.1), "line array: elements is 0; give a whole number of at least 1"),
    (lambda: line_array(2.5, 0.1), "elements is 2.5"),
    (lambda: line_array(4, -0.1), "line array: pitch is -0.1 m; give a finite length above 0"),
    (lambda: line_array(4, 0.1, axis="sideways"), 'axis is "sideways"; give one of forward, aft, starboard'),
    (lambda: line_array(4, 0.1, axis=(0, 1)), "axis is (0, 1); give three finite numbers"),
    (lambda: planar_array(4, 4, 0.1, axis="down"), "planar array: axis and normal are parallel"),
    (lambda: planar_array(4, 4, 0.1, row_pitch=0), "row_pitch is 0 m"),
    (lambda: mills_cross(4, 4, 0.1, receive_pitch=-1), "pitch is -1 m"),
    (lambda: cylindrical_array(4, 0.1, aperture=7), "aperture is 7 rad; give an angle above 0 and at most 2 pi"),
    (lambda: spherical_array(4, 0), "spherical array: radius is 0 m"),
    (lambda: line_array(4, 0.1, length=0.1), "elements are omni, but their length is 0.1 m"),
    (lambda: line_array(4, 0.1, pattern="circular", length=0.1, height=0.1), "the length is the diameter"),
    (lambda: line_array(4, 0.1, pattern="rectangular", length=-0.1), "element length is -0.1 m"),
    (lambda: line_array(4, 0.1, pattern="square"), 'pattern is "square"; give one of omni, rectangular, circular'),
    (lambda: line_array(4, 0.1, baffle="steel"), 'baffle is "steel"; give one of none, hard, soft, cardioid'),
    (lambda: line_array(4, 0.1).shaded("hanning"), 'window is "hanning" (did you mean "hann"?); give'),
    (lambda: line_array(4, 0.1).shaded("kaiser"), 'window is "kaiser", but kaiser takes the numbers (beta)'),
    (lambda: line_array(4, 0.1).shaded("hann 3"), "hann takes no numbers"),
    (lambda: line_array(4, 0.1).shaded("taylor four"), 'window is "taylor four", but taylor takes the numbers'),
    (lambda: line_array(4, 0.1).shaded("chebwin -30"), 'window is "chebwin -30", but chebwin takes the numbers '
                                                       '(attenuation in dB), of 0 or more'),
    (lambda: line_array(4, 0.1).shaded(("tukey", 3)), "tukey takes the numbers (tapered share = 0.5), from 0 to 1"),
    (lambda: line_array(2, 0.1).shaded("hann"), 'window "hann" leaves nothing of 2 elements'),
    (lambda: line_array(4, 0.1).shaded("hann", "hann"), "got 2 windows for 1 axes"),
    (lambda: spherical_array(4, 0.1).shaded("hann"), "stand in no regular order"),
    (lambda: line_array(4, 0.1).failing(4), "element 4 is to fail, but there are 4; give numbers from 0 to 3"),
    (lambda: line_array(4, 0.1).failing([-1]), "element -1 is to fail"),
    (lambda: line_array(4, 0.1).failing([1.5]), "failed elements are [1.5]; give whole numbers"),
    (lambda: line_array(2, 0.1).failing([0, 1]), "no element has a weight"),
    (lambda: line_array(2, 0.1).jittered(-1), "rms of position errors is -1 m"),
    (lambda: line_array(2, 0.1).steered([0, 0, 0], SPEED), "steering direction is [0, 0, 0]"),
    (lambda: line_array(2, 0.1).steered("down", 0), "sound_speed is 0 m/s"),
    (lambda: line_array(2, 0.1).focused([0, 1], SPEED), "point to focus on is [0, 1]"),
    (lambda: line_array(2, 0.1).moved([0, 1, np.nan]), "offset is [0, 1, nan]"),
    (lambda: beam_pattern(line_array(2, 0.1).steered("port", SPEED), [0, 0, 1], 0.1), "give sound_speed [m/s]"),
    (lambda: directivity_index_db(line_array(64, 1.0), [0, 0, 1], 0.01), "an array of radius 31.5 m at a wavelength"),
])
def test_refusals(make, words):
    with pytest.raises(ValueError) as caught:
        make()
    assert words in str(caught.value) and "\n" not in str(caught.value)
