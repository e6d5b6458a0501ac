"""From echoes to images, one kind of sonar a file; and images of fans as pictures in metres.

    picture = mitsonar.imaging.cartesian(image, cell=0.05)                  (ping, y, x)
    chart = mitsonar.imaging.mosaic([north, south], cell=0.25)              (y, x), eastings and northings
"""
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .maps.mosaics import mosaic
    from .maps.raster import cartesian

__all__ = ["cartesian", "mosaic"]


def __getattr__(name: str) -> Any:
    """Import the two functions when they are asked for: xarray takes a third of a second, and scenes load without."""
    if name == "mosaic":
        from .maps.mosaics import mosaic

        return mosaic
    if name == "cartesian":
        from .maps.raster import cartesian

        return cartesian
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """Return the names of the room, both functions among them before they are asked for."""
    return sorted({*globals(), *__all__})
