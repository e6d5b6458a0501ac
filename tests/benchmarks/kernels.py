"""Cost of an image of a sweep beside its rendering, and kernels that are compiled anew when only numbers change.

    kernels.py                          100 small images of every kind of sonar
    kernels.py --whole --kinds fan      images as large as the scene's own, of one kind

Every image is of a shipped scene with numbers of its own, as a sweep draws them, and is made as a process of a sweep
makes it: the scene is loaded, rendered and written, as a sample where its objects have classes, else as EXR. CPU
seconds are medians from the fourth image on. A kernel counts as new if no image before had it, whether Dr.Jit compiles
it or finds it on disk. Kernels depend on what there is to compute, such as a ping that sees no object; what few images
have is therefore compiled late, and the last column names the image in which this happened last.
"""
import argparse
import io
import os
import tempfile
import time
import warnings
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from measuring import ROOT, machine, table

ENOUGH = 3                         # images before the first that is timed


class Kind(NamedTuple):
    """Scene, parameters that make it small, spans of what is drawn, and the rules of its samples, if it has any."""

    scene: str
    small: dict[str, object]
    drawn: dict[str, tuple[float, float]]
    labels: dict[str, object] | None = None


SEED = (0, 1_000_000)              # a whole number is drawn
KINDS = {
    "sidescan": Kind("minefield", {"pings": 20, "rays": 20_000}, {
        "bed_seed": SEED, "target_seed": SEED, "motion_seed": SEED, "altitude": (4.0, 8.0), "sand_db": (-28.0, -22.0),
        "ripple_heading_deg": (0.0, 180.0), "ripple_wavelength": (0.7, 2.0), "ripple_height": (0.0, 0.08)}, {}),
    "fan": Kind("divers", {"beams": 64, "elements": 32}, {
        "bed_seed": SEED, "target_seed": SEED, "sonar_z": (-10.5, -8.0), "tilt_deg": (5.0, 20.0),
        "swimmer_range": (4.0, 17.0), "swimmer_bearing_deg": (-50.0, 50.0), "swimmer_heading_deg": (0.0, 360.0),
        "swimmer_pitch_deg": (-30.0, 30.0), "swimmer_z": (-11.2, -8.5), "ripple_wavelength": (0.5, 1.5),
        "ripple_height": (0.0, 0.06), "ripple_heading_deg": (0.0, 180.0), "roughness": (0.01, 0.05),
        "sand_db": (-30.0, -24.0), "suit_db": (-18.0, -14.0)}, {"form": "cartesian", "cell": 0.03}),
    "sector_scan": Kind("sector_scan", {"pings": 6}, {
        "height": (-10.0, -8.0), "tilt_deg": (5.0, 12.0), "range": (20.0, 28.0), "speed_knots": (0.1, 1.0)}),
    "multibeam": Kind("multibeam", {"pings": 1, "preset": "shallow_400khz", "range": 60}, {
        "bed_seed": SEED, "depth": (20.0, 24.0), "slope_deg": (0.5, 5.0), "speed_knots": (4.0, 8.0),
        "ripple_height": (0.05, 0.2), "ripple_wavelength": (2.0, 4.0), "roughness": (0.01, 0.04),
        "roll_bias_deg": (-0.1, 0.1), "head_speed_error": (-1.0, 1.0)}),
    "interferometric": Kind("interferometric", {"pings": 2}, {
        "bed_seed": SEED, "depth": (15.0, 20.0), "slope_deg": (0.5, 4.0), "speed_knots": (4.0, 6.0),
        "ripple_height": (0.1, 0.3), "ripple_wavelength": (3.0, 5.0), "box_height": (2.0, 4.0),
        "roll_bias_deg": (-0.1, 0.1), "range": (55.0, 70.0)}),
    "synthetic_aperture": Kind("synthetic_aperture", {"pings": 2, "range": 31, "cell": 0.05}, {
        "bed_seed": SEED, "motion_seed": SEED, "sway": (0.005, 0.02), "heave": (0.005, 0.02), "yaw_deg": (0.1, 0.3),
        "depth": (22.0, 25.0), "ripple_height": (0.01, 0.05), "ripple_wavelength": (0.2, 0.4),
        "speed_knots": (2.5, 3.5)}),
    "echo_sounder": Kind("echo_sounder", {"pings": 4}, {
        "bed_seed": SEED, "depth": (35.0, 45.0), "slope_deg": (1.0, 6.0), "speed_knots": (3.0, 5.0),
        "fish_db": (-45.0, -30.0), "water_db": (-85.0, -75.0), "range": (45.0, 55.0)}),
}


class Image(NamedTuple):
    """CPU seconds of an image's three parts, its bytes as written, kernels that were run, and those that are new."""

    load: float
    render: float
    write: float
    bytes: int
    launched: int
    new: int


def numbers(kind: Kind, index: int) -> dict[str, float]:
    """Draw the numbers of an image."""
    chance = np.random.default_rng([1, index])
    return {name: int(chance.integers(SEED[1])) if span is SEED else float(chance.uniform(*span))
            for name, span in kind.drawn.items()}


def parts(kind: Kind, whole: bool, folder: str) -> tuple[Callable, Callable, Callable]:
    """Return what loads an image's scene, renders it, and writes it."""
    import mitsonar
    from mitsonar.io.records import exr
    from mitsonar.labels.samples import write_sample
    from mitsonar.sweep.products import sample_rules

    def load(index):
        return mitsonar.load_file(ROOT / "scenes" / f"{kind.scene}.xml",
                                  **({} if whole else kind.small), **numbers(kind, index))

    def write(image):
        if kind.labels is None:
            exr.write(image, path := os.path.join(folder, "image.exr"))
            return os.path.getsize(path)
        classes = sorted({entry["class"] for entry in image.attrs["objects"].values()})
        write_sample(image, sample := io.BytesIO(), "0000", sample_rules(kind.labels, classes))
        return sample.tell()

    return load, lambda scene, index: mitsonar.render(scene, seed=index), write


def images(kind: Kind, count: int, whole: bool) -> list[Image]:
    """Make images as a process of a sweep does."""
    import drjit as dr

    known: set[object] = set()
    made: list[Image] = []

    def one(index):                # a function, so that a scene is gone before the next one is loaded
        dr.kernel_history_clear()
        begin = time.process_time()
        scene = load(index)
        loaded = time.process_time()
        image = render(scene, index)
        rendered = time.process_time()
        size = write(image)
        written = time.process_time()
        run = [entry["hash"] for entry in dr.kernel_history([dr.KernelType.JIT])]
        made.append(Image(loaded - begin, rendered - loaded, written - rendered, size, len(run), len({*run} - known)))
        known.update(run)

    with tempfile.TemporaryDirectory() as folder, dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        load, render, write = parts(kind, whole, folder)
        for index in range(count):
            one(index)
    return made


def main():
    """Run what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--images", type=int, default=100, help="of each kind")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=[*KINDS])
    parser.add_argument("--whole", action="store_true", help="images as large as the scenes' own")
    arguments = parser.parse_args()
    import mitsonar  # noqa: F401  (chooses libLLVM)

    warnings.simplefilter("ignore")                        # of objects that no ping sees
    print(machine())
    rows = []
    for name in arguments.kinds:
        made = images(KINDS[name], arguments.images, arguments.whole)
        steady = np.array(made[min(ENOUGH, len(made) - 1):])
        load, render, write, size, launched, _ = np.median(steady, 0)
        later = [number for number, image in enumerate(made[1:], 2) if image.new]
        rows.append([name, f"{1e3 * load:.0f}", f"{1e3 * render:.0f}", f"{1e3 * write:.0f}",
                     f"{(load + write) / render:.2f}", f"{3600 / (load + render + write):.0f}", f"{size / 1e3:.0f}",
                     f"{launched:.0f}", made[0].new, sum(image.new for image in made[1:]), later[-1] if later else "-"])
    table([f"{arguments.images} images each", "load [ms]", "render [ms]", "write [ms]", "beside rendering",
           "per CPU hour", "kB", "kernels run", "new in 1", "new later", "last new in"], rows)


if __name__ == "__main__":
    main()
