"""The commands that render: render, signals, demo.

Raw echoes of a synthetic aperture are written ping by ping, and the same command continues after an interruption.
"""
from __future__ import annotations

import argparse
import contextlib
import os
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from mitsonar.io.scene_files import scenes

from .arguments import Commands, add_gain, add_scene, check_output, check_picture, gain, parameters, set_up, whole
from .completion import add_file
from .progress import Progress, long_run
from .words import announce, leave_if_interrupted, warn

if TYPE_CHECKING:
    import mitsuba as mi
    import xarray as xr

    from mitsonar.imaging.gain import Tvg

EVERY = "all"                      # value of --sensor for all sonars
# pings that pass all targets, and rays of which 13 reach a bin: their noise is a seventh of the speckle
DEMO = {"pings": 560, "rays": 24_000}
OF_ARRAYS = (("--ping", "ping", None), ("--response", "response", False), ("--kernel", "kernel", "band_limited"),
             ("--return-path", "return_path", "vector"), ("--path", "path", None))     # option, name, default


def add(commands: Commands) -> None:
    """Add the commands to the parser's."""
    render = commands.add_parser("render", help="render a scene to an EXR")
    add_scene(render, sensors=", or all, each to a file of its own, OUT_ID.exr")
    add_file(render, "-o", "--output", required=True, metavar="OUT.exr", help="sonar image")
    add_file(render, "--preview", metavar="OUT.png", help="also write a picture with axes and scale")
    add_gain(render, "recorder", "display gain over range of the preview")
    render.add_argument("--each-ping", action="store_true",
                        help="write each ping of a fan of beams to a file of its own, OUT_0000.exr and so on")
    render.add_argument("--processes", type=whole, default=1, metavar="N",
                        help="processes that share the pings of a long survey, each with --threads; default: 1")
    render.set_defaults(run=_render)

    signals = commands.add_parser("signals", help="write the signals of an array's elements, or the raw echoes of "
                                                  "a synthetic aperture, to a netCDF file")
    add_scene(signals)
    add_file(signals, "-o", "--output", required=True, metavar="OUT.nc", help="signals")
    signals.add_argument("--ping", type=whole, action="append", metavar="N",
                         help="number of a ping, from 0; repeatable; default: all")
    signals.add_argument("--response", action="store_true",
                         help="write the impulse response of every pair of elements instead")
    signals.add_argument("--kernel", default="band_limited", help="band_limited (default), peterson or nearest")
    signals.add_argument("--return-path", default="vector", help="vector (default), paper or eigenray")
    signals.add_argument("--path", action="append", metavar="NAME",
                         help="only echoes along this path, such as b, bs or v; repeatable; default: all")
    add_file(signals, "--scatterers", metavar="OUT.nc",
             help="also write the scatterers behind the echoes of a synthetic aperture")
    signals.set_defaults(run=_signals)

    demo = commands.add_parser("demo", help="render the demo scene into an EXR and a picture beside it")
    add_file(demo, "-o", "--output", default="demo.exr", metavar="OUT.exr",
             help="sonar image, and OUT.png beside it; default: demo.exr and demo.png here")
    demo.add_argument("--seed", type=whole, default=0, metavar="N", help="random seed; default: 0")
    demo.set_defaults(run=lambda arguments: _render_to(scenes.find("sidescan_targets"), DEMO, arguments.seed,
                                                       arguments.output,
                                                       f"{os.path.splitext(arguments.output)[0]}.png", None))


def _render(arguments):
    if arguments.each_ping:
        _render_pings(arguments)
    else:
        if arguments.preview is None and arguments.tvg != "recorder":
            raise ValueError(f"--tvg {arguments.tvg} is for a preview, and none is asked for; add --preview OUT.png, "
                             "or leave it out.")
        _render_to(scenes.find(arguments.scene), parameters(arguments), arguments.seed, arguments.output,
                   arguments.preview, arguments.threads, arguments.sensor, gain(arguments), arguments.processes)


def _signals(arguments):
    from mitsonar.io.records import signals as netcdf

    path = scenes.find(arguments.scene)
    check_output(arguments.output, (".nc",))
    from mitsonar.scene.loading import load_for_sonar
    from mitsonar.verbs.images import element_signals, impulse_response, opened, pings

    set_up(arguments.threads)
    scene = load_for_sonar(path, **parameters(arguments))
    if opened(scene, arguments.sensor)[1].kind == "synthetic_aperture":
        _write_strip(arguments, scene)
        return
    if arguments.scatterers is not None:
        raise ValueError("--scatterers applies to a synthetic aperture only; leave it out for this sensor.")
    compute = impulse_response if arguments.response else element_signals
    with Progress() as progress:
        sensor = arguments.sensor
        recorded = compute(scene, arguments.ping or range(pings(scene, sensor=sensor)), kernel=arguments.kernel,
                           return_path=arguments.return_path, seed=arguments.seed, sensor=sensor,
                           paths=arguments.path, progress=progress, say=warn)
    netcdf.write(arguments.output, recorded)
    announce(arguments.output)


def _write_strip(arguments: argparse.Namespace, scene: mi.Scene) -> None:
    """Write the raw echoes of a scene's synthetic aperture."""
    from mitsonar.device.files import check_writable
    from mitsonar.io.records import netcdf, raw_echoes
    from mitsonar.verbs.strips import raw_pings, scatterers

    for option, name, usual in OF_ARRAYS:
        if getattr(arguments, name) != usual:
            raise ValueError(f"{option} is for other arrays, and this sensor is a synthetic_aperture; "
                             "leave it out.")
    if arguments.scatterers is not None:
        check_output(arguments.scatterers, (".nc",))
        if os.path.realpath(arguments.scatterers) == os.path.realpath(arguments.output):
            raise ValueError(f"{arguments.scatterers} is the name of two outputs; give another name for --scatterers.")
        netcdf.write(scatterers(scene, arguments.seed, sensor=arguments.sensor), arguments.scatterers)
        announce(arguments.scatterers)
    counts: list[int] = []
    start = raw_echoes.written(arguments.output)
    planned = raw_pings(scene, arguments.seed, sensor=arguments.sensor, count=counts.append)
    leave_if_interrupted(raw_echoes.part_of(check_writable(arguments.output)))
    with Progress() as progress:
        def pings_from(number: int) -> Iterator[xr.Dataset]:
            pings = planned if number == 0 else raw_pings(scene, arguments.seed, sensor=arguments.sensor, start=number)
            return _with_estimate(pings, number, counts[0])

        raw_echoes.write(pings_from, arguments.output, count=counts[0],
                         progress=lambda done, total: progress(done - start, total - start))
    announce(arguments.output)
    if start:
        warn(f"{start} of {counts[0]} pings were already in the file")


def _with_estimate(pings: Iterator[xr.Dataset], start: int, count: int) -> Iterator[xr.Dataset]:
    """Yield the pings; after the first, print the expected size and time of a long run."""
    from mitsonar.io.records.raw_echoes import size_of

    began = time.monotonic()
    for number, ping in enumerate(pings, start):
        if number == start and (expected := long_run(began, count - start)):
            _, receivers, samples = ping["signal"].shape
            size = size_of(ping, count)
            text = f"{size / 1e9:.3g} GB" if size >= 1e9 else f"{size / 1e6:.3g} MB"
            warn(f"{count - start} pings of {receivers} receivers x {samples} samples: {text}, {expected}; if "
                 "interrupted, the same command goes on")
        yield ping


def _render_to(path, values, seed, output, preview, threads, sensor=0, tvg: Tvg = "recorder", processes=1):
    _check_outputs(output, preview)
    from mitsonar.io.records import exr
    from mitsonar.scene.loading import load_for_sonar
    from mitsonar.verbs.images import opened, rendered

    set_up(threads)
    scene = load_for_sonar(path, **values)
    asked = list(_sensors(scene, sensor))
    for which, _ in asked if preview and tvg == "counts" else ():
        if opened(scene, which)[1].recorder is None:
            raise ValueError("a preview of counts is asked for, and the sonar has no recorder; give it one, or another "
                             "--tvg.")
    for which, suffix in asked:
        image, picture = _with_suffix(output, suffix), preview and _with_suffix(preview, suffix)
        job = {"scene": path, "parameters": values, "seed": seed, "sensor": which}
        # several processes end their first parts at about the same time
        with _run_parts(job, processes, threads) as run_parts, Progress(warm_up=processes) as progress:
            dataset = rendered(scene, seed, which, progress, warn, run_parts=run_parts)
        exr.write(dataset, image)
        announce(image)
        if picture is not None:
            from mitsonar import plots

            plots.preview(dataset, picture, tvg=tvg)
            announce(picture)


@contextlib.contextmanager
def _run_parts(job, processes, threads):
    """Yield the function that computes the parts of a record: here, or by processes that end with the context."""
    if processes == 1:
        yield map
        return
    from mitsonar.sweep.manifest import versions
    from mitsonar.sweep.pools.local import Local, shares
    from mitsonar.sweep.pools.picture_jobs import PictureParts

    processes, threads = shares(processes, threads)
    with Local(processes, threads, os.getcwd()) as pool:
        yield PictureParts(pool, {**job, "versions": versions(), "folder": os.getcwd()})


def _sensors(scene, asked):
    """Return the sensors to render, by number or id, each with the suffix of its file's name."""
    ids = [sensor.id() for sensor in scene.sensors()]
    if asked == EVERY and EVERY not in ids:
        return [(number, f"_{name}".replace(os.sep, "_")) for number, name in enumerate(ids)]
    if asked == 0 and len(ids) > 1:
        warn(f"the scene has {len(ids)} sonars, and {ids[0]} is rendered; --sensor all renders "
             f"{'both' if len(ids) == 2 else 'each'} to a file of its own")
    return [(asked, "")]


def _with_suffix(path, suffix):
    base, ending = os.path.splitext(path)
    return f"{base}{suffix}{ending}"


def _render_pings(arguments):
    if arguments.preview is not None:
        raise ValueError("--preview and --each-ping are both given; draw the pings by `mitsonar plot` or `mitsonar "
                         "video`, or leave one of them out.")
    if arguments.processes != 1:
        raise ValueError("--processes and --each-ping are both given, and single pings are rendered in one process; "
                         "leave one of them out.")
    _check_outputs(arguments.output, None)
    from mitsonar import frames
    from mitsonar.io.records import exr
    from mitsonar.scene.loading import load_for_sonar
    from mitsonar.verbs.images import pings

    set_up(arguments.threads)
    scene = load_for_sonar(scenes.find(arguments.scene), **parameters(arguments))
    if arguments.sensor == EVERY:
        raise ValueError("--sensor all and --each-ping are both given; name one sonar, or leave one of them out.")
    images = frames(scene, seed=arguments.seed, sensor=arguments.sensor)
    base = os.path.splitext(arguments.output)[0]
    with Progress() as progress:
        total = pings(scene, sensor=arguments.sensor)
        for number, image in enumerate(images):
            exr.write(image, f"{base}_{number:04d}.exr")
            progress(number + 1, total)
    announce(f"{base}_0000.exr to {base}_{total - 1:04d}.exr" if total > 1 else f"{base}_0000.exr")


def _check_outputs(output, preview):
    """Check both names before rendering, which may take an hour."""
    try:
        f"{output}{preview}".encode()
    except UnicodeEncodeError:
        raise ValueError("cannot write a file whose name is not UTF-8; give another name") from None
    check_output(output, (".exr",), "; pictures are made by --preview")
    check_picture(preview)
