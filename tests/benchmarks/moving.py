"""Cost of what moves: frames with ten objects that move, against the same at rest; waves, against a level surface.

    python tests/benchmarks/moving.py                     CPU of a forward-looking sonar's frame, in turn
    python tests/benchmarks/moving.py --objects 20        with another number of divers, of 1,000 triangles each

Frames of all scenes are made in turn in one process, and medians of their CPU seconds, of all threads, compared. The
first frames, which compile kernels and build tables, are not counted. Beside them stands a scene without the objects.
The surface is 60 m wide and 9 m above a sonar that looks down.
"""
import argparse
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
WAYS = {"none": "still", "still": "still", "moving": "still", "level": "level", "waves": "level"}      # against what


def main(argv=None):
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--objects", type=int, default=10)
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--beams", type=int, default=256)
    arguments = parser.parse_args(argv)
    import measuring

    cost = frames_in_turn(arguments.objects, arguments.frames, arguments.beams)
    print(measuring.machine() + "\n")
    print(f"{'scene':10}{'CPU s':>8}{'ratio':>8}")
    for way, against in WAYS.items():
        print(f"{way:10}{cost[way]:8.3f}{cost[way] / cost[against]:8.3f}")


def frames_in_turn(objects, frames, beams):
    """Return the median CPU seconds of a frame by the way that objects are there."""
    import mitsonar

    makers = {way: mitsonar.frames(scene(way, objects, frames + 2, beams), seed=1) for way in WAYS}
    cost = {way: [] for way in WAYS}
    for number in range(frames + 2):
        for way, maker in makers.items():
            begin = time.process_time()
            next(maker)
            if number > 1:
                cost[way].append(time.process_time() - begin)
    return {way: float(np.median(seconds)) for way, seconds in cost.items()}


def scene(way, objects, pings, beams):
    """Load the scene: the sonar of scenes/divers, a bed of 320,000 facets, and divers over it."""
    from mitsonar.validation.scenes import at_rest, lambert, loaded

    bed = {"type": "seabed", "depth": 12.0, "length": 40.0, "width": 40.0, "spacing": 0.1, "fractal_rms": 0.03,
           "fractal_gamma": 3.4, "fractal_outer_scale": 20.0, "bsdf": lambert(-27)}
    sea = {"type": "sea_surface", "wind_speed": 5.0, "size": 60.0}
    waves = {"waves": "jonswap", "wave_height": 0.3, "wave_period": 3.0}
    place, shapes = np.random.default_rng(1), {"level": {"sea": sea}, "waves": {"sea": {**sea, **waves}}}.get(way, {})
    for number in range(objects if way in ("still", "moving") else 0):
        start = [float(v) for v in (place.uniform(-6, 6), place.uniform(5, 13), -10.8)]
        shapes[f"diver{number}"] = diver(start) if way == "still" else {
            "type": "moving", "shape": diver(), "start": start, "speed": 1.0,
            "heading_deg": float(place.uniform(0, 360))}
    return loaded({"bed": bed, **shapes}, {"type": "forward_looking", "preset": "multibeam_750khz"}, at_rest(9.0), {
        "pings": pings, "beams": beams, "receive_elements": 128, "bandwidth_khz": 40.0, "tilt_deg": 10.0},
        None, {"range_min": 1.5, "range": 18.0}, {})


def diver(place=(0.0, 0.0, 0.0)):
    """Return a diver of 1,000 triangles at a place [m]."""
    from mitsonar.scene.loading import prepare
    from mitsonar.validation.scenes import lambert

    prepare()
    import mitsuba as mi

    return {"type": "ply", "filename": str(ROOT / "scenes/meshes/diver.ply"), "face_normals": True,
            "to_world": mi.ScalarTransform4f().translate(list(place)), "material": lambert(-16)}


if __name__ == "__main__":
    main()
