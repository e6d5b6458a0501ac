"""Maps of sediment classes on a survey: a raster of codes, and a table with the sediment of each code.

    1: clay, 7: medium sand, nodata: sandy silt

Each cell of the survey takes the class of the map cell in which its middle lies; the map may have another coordinate
system. Near a border, `Painting` also holds the class on the other side and its share, as `scattering.borders` mixes
them: the classes around a cell, weighted by a triangle of base w in both directions (two running means, each over w/2).
Where more than two classes meet, the most frequent of the other classes counts.
"""
import os
from dataclasses import dataclass

import numpy as np

from mitsonar.device.files import FilePath
from mitsonar.seabed.roughness import sediment_key

from ..scene_files import tables
from . import raster_files
from .bathymetry import Bathymetry


def blended(numbers: np.ndarray, known: np.ndarray, count: int,
            width: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return the class (Y, X) beyond the border nearest to every cell, and its share (Y, X); ``width`` in cells."""
    from scipy.ndimage import uniform_filter1d

    half = [min(max(1, round(0.5 * cells)), length) for cells, length in zip(width, numbers.shape)]

    def smoothed(values: np.ndarray) -> np.ndarray:
        values = values.astype(np.float32)
        for axis, size in enumerate(half):
            # a mean over an even number of cells is shifted by half a cell, so the two are shifted oppositely
            values = uniform_filter1d(values, size, axis, mode="nearest")
            values = uniform_filter1d(values, size, axis, mode="nearest", origin=-1 if size % 2 == 0 else 0)
        return values

    most, own = np.zeros(numbers.shape, np.float32), np.zeros(numbers.shape, np.float32)
    other = numbers.astype(np.uint32)
    for number in range(count):
        here = known & (numbers == number)
        about = smoothed(here)
        own[here] = about[here]
        better = ~here & (about > np.maximum(most, 1e-6))
        most[better], other[better] = about[better], number
    share = np.where(known, most / np.maximum(own + most, 1e-6), 0)
    return other, share.astype(np.float32)


_SHOWN = 10                   # codes that an error lists


@dataclass(frozen=True, kw_only=True)
class ClassTable:
    """Sediments that the codes of a map stand for."""

    classes: dict[int, str]  # code -> sediment of TR 9407
    elsewhere: str | None = None  # sediment where the map has no code

    @classmethod
    def of(cls, text: str) -> "ClassTable":
        """Make a table from a text such as "1: clay, 7: medium sand, nodata: sand", or from a CSV file.

        The file has the columns ``code`` and ``sediment``. In both forms "nodata" is a code.
        """
        if os.path.isfile(text):
            names, _, rows = tables.records(text, "class table")
            if not {"code", "sediment"} <= set(names):
                raise ValueError(f"{text}: the columns are {', '.join(names)}; a class table has code and sediment.")
            pairs = [(row[names.index("code")], row[names.index("sediment")]) for row in rows]
        else:
            pairs = [entry.partition(":")[::2] for entry in text.split(",") if entry.strip()]
        classes = {}
        for code, sediment in pairs:
            code = code.strip().lower()
            if code != "nodata":
                try:
                    code = int(code)
                except ValueError:
                    raise ValueError(f'the class table has the code "{code}", which is no whole number; write it as '
                                     '"1: clay, 7: sand, nodata: silt", or name a CSV file.') from None
            if code in classes:
                raise ValueError(f"the class table has the code {code} twice.")
            classes[code] = sediment_key(sediment.strip())
        elsewhere = classes.pop("nodata", None)
        if not classes:
            raise ValueError('the class table has no codes; write it as "1: clay, 7: sand, nodata: silt", or name a '
                             "CSV file.")
        return cls(classes=classes, elsewhere=elsewhere)

    @property
    def sediments(self) -> list[str]:
        """Return the sediments, each once, in the order in which `numbers` counts them."""
        named = [*self.classes.values(), *([self.elsewhere] if self.elsewhere else [])]
        return list(dict.fromkeys(named))

    def numbers(self, codes: np.ndarray) -> np.ndarray:
        """Return the indices (N,) into ``sediments`` of codes (N,); NaN means that the map has no code."""
        distinct, inverse = np.unique(codes, return_inverse=True)
        place = np.zeros(distinct.size, np.uint32)
        unknown = [code for code in distinct if np.isfinite(code) and code not in self.classes]
        if unknown:
            listed = ", ".join(f"{code:g}" for code in unknown[:_SHOWN])
            share = np.isin(codes, unknown).mean()
            known = ", ".join(map(str, self.classes))
            raise ValueError(f"the map has the code{'s' * (len(unknown) > 1)} {listed} on {share:.1%} of the seabed, "
                             f"and the class table knows {known}; add what is missing.")
        for index, code in enumerate(distinct):
            sediment = self.classes[int(code)] if np.isfinite(code) else self.elsewhere
            if sediment is None:
                raise ValueError(f"the map has no class on {np.isnan(codes).mean():.1%} of the seabed; say what lies "
                                 'there by the code nodata in the class table: "nodata: medium sand".')
            place[index] = self.sediments.index(sediment)
        return place[inverse.ravel()]


@dataclass(frozen=True, kw_only=True)
class Painting:
    """Sediments of a map on the cells of a survey."""

    number: np.ndarray  # (N,): indices into `ClassTable.sediments`
    other: np.ndarray  # (N,): class beyond the nearest border
    share: np.ndarray  # (N,): share of that class, 0 away from borders


def paint(path: FilePath, survey: Bathymetry, table: ClassTable, cells: np.ndarray | None = None, *,
          crs: str | None = None, border: float | None = None) -> Painting:
    """Read the classes as `read`, with mixed borders of width ``border`` [m]; by default that of a cell of the map."""
    codes, cell_size = _read(path, survey, crs)
    chosen = np.arange(codes.size) if cells is None else cells
    number = _named(path, table, codes.ravel()[chosen])
    known = np.isin(codes, list(table.classes)) | (np.isnan(codes) & (table.elsewhere is not None))
    numbers = np.zeros(codes.shape, np.uint32)
    numbers[known] = table.numbers(codes[known])
    width = cell_size if border is None else border
    step = survey.spacing
    other, share = blended(numbers, known, len(table.sediments), (width / step[1], width / step[0]))
    return Painting(number=number, other=other.ravel()[chosen], share=share.ravel()[chosen])


def read(path: FilePath, survey: Bathymetry, table: ClassTable, cells: np.ndarray | None = None, *,
         crs: str | None = None) -> np.ndarray:
    """Read the classes of a map on cells between the nodes of a survey, all or the numbered ``cells`` (N,)."""
    codes = _read(path, survey, crs)[0].ravel()
    return _named(path, table, codes if cells is None else codes[cells])


def _read(path, survey, crs):
    """Return the codes of the survey's cells, and the size of the map's own cells [m]."""
    try:
        with raster_files.opened(path, crs=crs, what="map of classes") as (raster, source):
            return _codes(raster, source, survey), _cell(raster, source, survey)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _named(path, table, codes):
    try:
        return table.numbers(codes)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _cell(raster, source, survey):
    """Return the mean side [m] of the map's cells at its middle, in the coordinate system of the survey."""
    from rasterio.warp import transform

    at, column, row = raster.transform, raster.width / 2, raster.height / 2
    x, y = np.array([column, column + 1, column]), np.array([row, row, row + 1])
    # not by an operator: old versions of affine have no @, new ones are about to drop *
    east, north = at.a * x + at.b * y + at.c, at.d * x + at.e * y + at.f
    if source is not None and survey.crs:
        east, north = transform(source, survey.crs, east, north)
    east, north = np.asarray(east), np.asarray(north)
    return float(np.mean(np.hypot(east[1:] - east[0], north[1:] - north[0])))


def _codes(raster, source, survey):
    """Return the codes (Y - 1, X - 1) of the cells, rows from the south; NaN where the map has no code."""
    from rasterio.crs import CRS
    from rasterio.enums import Resampling
    from rasterio.transform import from_origin
    from rasterio.vrt import WarpedVRT

    if raster.count != 1:
        raise ValueError(f"the file has {raster.count} bands; a map of classes has one, not colours.")
    if raster.transform.is_identity:
        raise ValueError("the file has no georeference; add one (gdal_translate -a_ullr).")
    if source is not None and not survey.crs:
        raise ValueError("the map has a coordinate system and the survey none; give the survey's by crs.")
    west, south, east, north = survey.bounds
    rows, columns = (length - 1 for length in survey.heights.shape)
    step = survey.spacing
    system = CRS.from_user_input(survey.crs) if survey.crs else CRS()
    with WarpedVRT(raster, crs=system, src_crs=source or system, transform=from_origin(west, north, *step),
                   width=columns, height=rows, resampling=Resampling.nearest, dtype="float64", nodata=np.nan,
                   src_nodata=np.nan if raster.nodata is None else raster.nodata) as view:
        codes = view.read(1)[::-1]
    if np.isnan(codes).all():
        raise ValueError(f"the map has no class anywhere on the survey, which covers {west:.12g}, {south:.12g}, "
                         f"{east:.12g}, {north:.12g} (west, south, east, north{', ' * bool(survey.crs)}{survey.crs}); "
                         f"the map covers {', '.join(f'{value:.12g}' for value in raster.bounds)}.")
    odd = codes[np.isfinite(codes) & (codes != np.rint(codes))]
    if odd.size:
        raise ValueError(f"the map holds {odd[0]:g}, which is no code; classes are whole numbers.")
    return codes
