"""Find the files that a plugin reads, and report why one cannot be read."""
import os
from typing import Any

import mitsuba as mi


def resolved(name: str) -> str:
    """Return the path of a name, beside the scene or in the current folder; unknown names stay as they are."""
    resolver: Any = mi.file_resolver           # an object in Mitsuba's stubs
    return str(resolver().resolve(name))


def found_file(attribute: str, name: str) -> str:
    """Return the path of a readable file that a scene names, beside the scene or in the current folder."""
    path = resolved(name)
    if not os.path.isfile(path):
        if os.path.isdir(path):
            raise ValueError(f'{attribute} names the folder "{name}"; give the name of a file.')
        if os.path.exists(path):
            raise ValueError(f'{attribute} names "{name}", a device or a pipe; give the name of a file.')
        raise ValueError(f'{attribute} names the file "{name}", which is not there; it is looked for beside the scene, '
                         "then where you are.")
    if not os.access(path, os.R_OK):
        raise ValueError(f'{attribute} names the file "{path}", which you may not read; change its permissions.')
    return path
