"""Scenes and records in a page of the browser, with a time line: bed, objects, track, pings, soundings.

    page = mitsonar.view("scene.xml", "run.exr")     page.url, page.wait(), page.close(); notebooks show it
    mitsonar.view("run.exr", save="run.rrd")

`viewer` chooses what to show by kind, one module each; `view_log` records it, `page` serves it on this machine alone.
"""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
