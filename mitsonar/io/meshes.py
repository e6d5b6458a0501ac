"""Which files are meshes of targets, and whether they are worth handing to Mitsuba's readers."""
import re
from pathlib import Path

__all__ = ["KINDS", "check", "listed"]

KINDS = (".ply", ".obj")           # that Mitsuba reads
LARGEST = 50e6                     # [bytes] of a target's file: a million triangles


def listed(folder):
    """Give the meshes of a folder, sorted by name.

    Parameters
    ----------
    folder : str or path

    Returns
    -------
    list of Path

    Raises
    ------
    ValueError
        If there are none.
    """
    files = sorted(path for path in Path(folder).iterdir() if path.suffix.lower() in KINDS and path.is_file())
    if not files:
        raise ValueError(f"the folder {folder} holds no mesh; put {' or '.join(KINDS)} files into it")
    return files


def check(path):
    """Refuse a mesh that cannot be read, or that claims more than it can hold, before memory is given to it.

    Parameters
    ----------
    path : str or path

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is of no known kind, empty, too large, or a PLY header counts more elements than the file has bytes.
    """
    path = Path(path)
    if path.suffix.lower() not in KINDS:
        raise ValueError(f"{path} is no mesh that can be read; give a {' or '.join(KINDS)} file")
    if not path.is_file():
        raise FileNotFoundError(f"the mesh {path} is not there; it is looked for beside the scene, then where you are")
    size = path.stat().st_size
    if not 0 < size <= LARGEST:
        raise ValueError(f"the mesh {path} has {size} bytes; targets are meshes of at most {LARGEST:.0f} bytes")
    if path.suffix.lower() == ".ply":
        with path.open("rb") as file:
            header = file.read(65536).partition(b"end_header")[0]
        claimed = sum(int(count) for count in re.findall(rb"(?m)^element[ \t]+\S+[ \t]+(\d+)", header))
        if claimed > size:
            raise ValueError(f"the mesh {path} is cut off or damaged: its header counts {claimed} elements, but it has "
                             f"{size} bytes; export it again")
