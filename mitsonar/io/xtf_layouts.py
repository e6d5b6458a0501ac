"""Layouts of XTF's packets as NumPy reads and writes them: those of pyxtf, field by field."""
import ctypes

import numpy as np

__all__ = ["MAGIC", "structure"]

MAGIC = 0xFACE                     # first two bytes of a packet


def structure(layout: type[ctypes.Structure]) -> np.dtype:
    """Give a packet's layout as a NumPy type, inherited fields and all but arrays.

    Parameters
    ----------
    layout : a class of pyxtf

    Returns
    -------
    numpy.dtype
    """
    fields = {name: (np.dtype(kind), getattr(layout, name).offset) for cls in reversed(layout.__mro__)
              for name, kind in getattr(cls, "_fields_", ()) if not issubclass(kind, ctypes.Array)}
    return np.dtype({"names": list(fields), "formats": [kind for kind, _ in fields.values()],
                     "offsets": [at for _, at in fields.values()], "itemsize": ctypes.sizeof(layout)})
