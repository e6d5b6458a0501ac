"""Process that renders for a sweep, with jobs and answers as lines of JSON.

The process loads every scene from its files and writes the image. It ends when the process that started it ends, for
any reason, or after a long time without a job.
"""
import json
import os
import queue
import signal
import sys
import threading
import time
import warnings
from typing import NoReturn

IDLE_SECONDS = 600.0
MOST_WARNINGS = 10


class _Refused(ValueError):
    """Error of a scene that refuses its parameters; other values may work."""


def main(threads: int) -> NoReturn:
    """Answer jobs until standard input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)       # the runner handles Ctrl-C
    replies = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)                                      # keeps output of libraries apart
    jobs = queue.Queue()
    threading.Thread(target=_listen, args=(jobs,), daemon=True).start()
    while True:
        try:
            job = jobs.get(timeout=IDLE_SECONDS)
        except queue.Empty:
            os._exit(0)
        replies.write(json.dumps(_answer(job, threads)) + "\n")
        replies.flush()


def _listen(jobs):
    for line in sys.stdin:
        jobs.put(json.loads(line))
    os._exit(0)                                        # also during a render, since no process awaits it


def _answer(job, threads):
    """Return the answer to a job, or its error."""
    from mitsonar.device.files import FULL
    from mitsonar.device.sentences import sentence

    start = time.perf_counter()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            answer = _do(job, threads)
        except (ValueError, OSError, MemoryError) as error:
            answer = {"error": sentence(error), "full": isinstance(error, OSError) and error.errno in FULL,
                      "refused": isinstance(error, _Refused)}
        except Exception as error:                     # other errors end this render, not the sweep
            answer = {"error": f"{type(error).__name__}: {sentence(error)}", "full": False}
    messages = list(dict.fromkeys(" ".join(str(warning.message).split()) for warning in caught
                                  if issubclass(warning.category, UserWarning)))
    return {**answer, "seconds": round(time.perf_counter() - start, 3), "warnings": messages[:MOST_WARNINGS]}


def _do(job, threads):
    from ..manifest import versions

    if job["versions"] != (ours := versions()):
        raise ValueError(f"the worker has other versions, {ours}, than the sweep, {job['versions']}; install the same "
                         "versions on both machines")
    if not os.path.isdir(job["folder"]):
        raise ValueError(f"the folder {job['folder']} is not there on the worker; give a folder by -o that all "
                         "workers see")
    import drjit as dr
    import mitsuba as mi

    from mitsonar import render
    from mitsonar.io.records import exr
    from mitsonar.scene.loading import load_for_sonar, prepare

    mi.set_log_level(mi.LogLevel.Error)
    prepare()
    if dr.thread_count() != threads:
        dr.set_thread_count(threads)

    from . import picture_jobs, sounding_jobs

    if "part" in job:
        return picture_jobs.part(job, lambda: load_for_sonar(job["scene"], **job["parameters"]))
    if "pings" in job:
        return sounding_jobs.block(job, lambda: load_for_sonar(job["scene"], **job["parameters"]))
    try:
        scene = load_for_sonar(job["scene"], **job["parameters"])
    except ValueError as error:
        raise _Refused(str(error)) from error
    if job["output"] is None:
        from mitsonar.verbs.images import opened

        opened(scene)
        return {}
    path = os.path.join(job["folder"], job["output"])
    os.makedirs(os.path.dirname(path), exist_ok=True)
    if job["soundings"] is not None:
        made = sounding_jobs.line(job, scene, path)
        return made if job["trial"] else {**made, **_content(path)}
    dataset, made = render(scene, seed=job["seed"]), {}
    if job["labels"] is not None:
        from mitsonar.device.files import replacing
        from mitsonar.labels.samples import write_sample

        from ..meshes import meshes_of
        from ..products import sample_rules

        with replacing(path) as temporary, open(temporary, "wb") as stream:
            tally = write_sample(dataset, stream, os.path.splitext(job["output"])[0], sample_rules(*job["labels"]),
                                 meshes_of(scene, job["scene"], job["parameters"]))
        made["labelled"] = tally.record()
    else:
        exr.write(dataset, path)
    if job["preview"] is not None:
        from mitsonar import plots

        plots.preview(dataset, os.path.join(job["folder"], job["preview"]))
    return {**made, **_content(path), "instruction_set": dataset.attrs["instruction_set"]}


def _content(path):
    """Return the size and the SHA-256 of a file."""
    from ..manifest import sha256

    return {"bytes": os.path.getsize(path), "sha256": sha256(path)}
