"""Images of a plan, rendered by the workers of PyTorch's DataLoader and read from the files of its sweep.

    on_the_fly.py [PLAN.toml] --images 24 --workers 0 1 2

Every image carries the clock of the process that made it. CPU seconds an image are the slope of that clock over the
images of a worker; images a second are those after each worker's first, which compiles kernels. Files are those of the
same renders: EXR, by `mitsonar.dataset.open`, and samples of one shard (picture and mask of classes).
"""
import argparse
import io
import sys
import tarfile
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "inputs"))

from measuring import machine, table  # noqa: E402  (found by the path above)
from small_scene import TEXT  # noqa: E402  (found by the path above)

import mitsonar  # noqa: E402  (found by the path above)

PLAN = """
scene = "scene.xml"
classes = ["mine"]
[set]
pings = 60
[draw]
rays = { integer = [19990, 20010] }
"""


def clock():
    """The worker, its CPU seconds, and the time."""
    torch = sys.modules.get("torch")
    info = torch and torch.utils.data.get_worker_info()
    return -1 if info is None else info.id, time.process_time(), time.perf_counter()


def noted(record):
    """The clock as a target."""
    return clock()


def samples(path):
    """Pictures and masks of a tar, with the clock after each."""
    import numpy as np
    from PIL import Image

    with tarfile.open(path) as tar:
        held = []
        for member in tar:
            if member.name.endswith(".class.png") or member.name.count(".") == 1 and member.name.endswith(".png"):
                held.append(np.array(Image.open(io.BytesIO(tar.extractfile(member).read()))))
            if member.name.endswith(".json"):
                yield held, clock()
                held = []


def figures(pairs):
    """Images a second and CPU seconds an image, from the clocks."""
    clocks = [clock for _, clock in pairs]
    workers = {worker: [one for one in clocks if one[0] == worker] for worker, *_ in clocks}
    rate = sum((len(ours) - 1) / (ours[-1][2] - ours[0][2]) for ours in workers.values() if len(ours) > 1)
    spent = sum(ours[-1][1] - ours[0][1] for ours in workers.values())
    return rate, spent / max(1, len(clocks) - len(workers))


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("plan", nargs="?")
    parser.add_argument("--images", type=int, default=24)
    parser.add_argument("--workers", type=int, nargs="+", default=[0, 1, 2])
    options = parser.parse_args()
    try:
        import torch
    except ImportError:
        torch = None
        print("PyTorch is not here (pip install torch): samples alone")
    from mitsonar.dataset.rendered_images import rendered
    from mitsonar.labels.rules import Labels
    from mitsonar.labels.samples import SampleRules, write_sample

    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "scene.xml").write_text(TEXT)
        (place / "plan.toml").write_text(f"samples = {options.images}" + PLAN)
        plan = mitsonar.sweep.load_plan(options.plan or place / "plan.toml")
        rows, count = [], min(options.images, len(plan))

        def loaded(way, data, workers):
            kind = {"multiprocessing_context": "spawn"} if workers else {}
            pairs = []
            for pair in torch.utils.data.DataLoader(data, batch_size=None, num_workers=workers, **kind):
                pairs.append(pair)
                if len(pairs) == count:
                    break
            add(way, workers, pairs)

        def add(way, workers, pairs):
            rate, cpu = figures(pairs)
            rows.append([way, str(workers), f"{rate:.2f}", f"{cpu:.4f}"])

        for workers in options.workers * (torch is not None):
            loaded("rendered", mitsonar.dataset.rendering(plan, target=noted), workers)
        rules = SampleRules(labels=Labels(masks=True, coco=True, classes=plan.classes or ["mine"]))
        with open(place / "shard.tar", "wb") as shard, tarfile.open(fileobj=shard, mode="w") as tar:
            for index in range(count):
                record, one = rendered(plan, index), io.BytesIO()
                mitsonar.io.write(record, place / f"{index:05}.exr")
                write_sample(record, one, f"{index:05}", rules)
                one.seek(0)
                with tarfile.open(fileobj=one) as parts:
                    for member in parts:
                        tar.addfile(member, parts.extractfile(member))
        images = mitsonar.dataset.open(sorted(place.glob("*.exr")))
        for workers in options.workers * (torch is not None):
            loaded("EXR", images.torch(target=noted), workers)
        add("a shard's samples", 0, list(samples(place / "shard.tar")))
    print(machine())
    table(["way", "workers", "images a second", "CPU s an image"], rows)


if __name__ == "__main__":
    main()
