"""Program libraries that a scene may have Mitsuba open: those of the Mitsuba package only.

For an object of ``type="NAME"`` Mitsuba opens ``plugins/NAME.so``. It looks for that file beside the scene, in the
folders of ``<path>`` and in the current folder before it looks in its own package, and opening a library runs it. A
plugin may also make others that the scene does not name, such as the film of a camera, and for dictionaries Mitsuba
looks for a library under the names of Python plugins, too. The types in a scene are therefore compared with a list, and
no library may lie where Mitsuba would open it under a name of that list.
"""
import functools
import os
import sys
from typing import Any

import mitsuba as mi

from mitsonar.device.sentences import shortened
from mitsonar.device.spelling import meant

from .errors import PLUGINS

SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")


def check_type(name: str) -> None:
    """Refuse a plugin that belongs neither to mitsonar nor to the Mitsuba package."""
    if name not in _known():
        raise ValueError(shortened(f'there is no plugin of type "{name}"{meant(name, PLUGINS)}; a scene may use the '
                                   "plugins of mitsonar and those of the Mitsuba package"))


def check_folders(resolver: Any) -> None:
    """Refuse a folder with a library that Mitsuba would open as one of its plugins."""
    # where it finds nothing, it takes the name as a path
    if not any(_may_hold_others(os.path.join(folder, "plugins")) for folder in (*map(str, resolver), "")):
        return
    for name, own in _known().items():
        library = str(resolver.resolve(f"plugins/{name}{SUFFIX}"))
        if os.path.exists(library) and not (own and os.path.samefile(library, own)):
            raise ValueError(f'{library} would run as program code wherever a scene needs the plugin "{name}"; remove '
                             "this file if you do not know what it is, or work in another folder")


def _may_hold_others(folder: str) -> bool:
    """Return True for a folder that holds a library, or may do so, and that is not the package's own."""
    try:
        return not os.path.samefile(folder, _own_folder()) and any(
            file.lower().endswith(SUFFIX) for file in os.listdir(folder))
    except (FileNotFoundError, NotADirectoryError):
        return False
    except OSError:
        return True


@functools.cache
def _own_folder() -> str:
    return os.path.join(os.path.dirname(mi.__file__), "plugins")


@functools.cache
def _known():
    """Return the library paths of the Mitsuba package by plugin name; None for plugins without a library."""
    folder = _own_folder()
    own = {os.path.splitext(file)[0]: os.path.join(folder, file) for file in os.listdir(folder)
           if file.endswith(SUFFIX)}
    return {"scene": None, **dict.fromkeys(PLUGINS), **own}
