"""Survey files as rasters: GDAL's formats, NumPy arrays, ESRI ASCII grids, lists of soundings and electronic charts.

GDAL reads most of them. Three kinds need care: a BAG of variable resolution is opened with its refinements, not as the
coarse overview; netCDF axes may lack attributes that GDAL requires; in text grids GDAL reads words and missing numbers
as 0.

Files are opened only as one of `DRIVERS`, formats that contain their grid themselves, whatever the file's name. GDAL
also recognises descriptions that refer to other files or to the network, which a survey must not do.

ESRI ASCII grids have six lines of header, then the heights by rows from the north. GDAL reads the header. The heights
are read here, because GDAL takes words, and numbers missing from a truncated file, for 0, which is a depth.
"""
import contextlib
import itertools
import os
import threading
import tokenize
import warnings
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from mitsonar.device.files import CLASSIC, HDF5, TIFF, FilePath, is_of_the_kernel

from ..records.self_contained import DataElsewhere, check_hdf5
from . import enc, soundings
from .rasters import MOST_NODES, source_crs

if TYPE_CHECKING:
    from rasterio.crs import CRS
    from rasterio.io import DatasetReader
    from rasterio.transform import Affine


_KEYS = ("ncols", "nrows", "xllcorner", "yllcorner", "xllcenter", "yllcenter", "cellsize", "dx", "dy", "nodata_value")
_BLOCK = 1 << 22  # characters read at a time
_LONGEST = 200    # characters of a line of the header


def is_ascii_grid(path: FilePath) -> bool:
    """Return True if a file starts as an ESRI ASCII grid does, whatever its name."""
    try:
        with open(path, "rb") as file:
            word = file.read(40).split()[:1]
    except OSError:
        return False
    return bool(word) and word[0].lower() in (b"ncols", b"nrows")


def read_values(path: FilePath, rows: int, columns: int) -> np.ndarray:
    """Read the heights of an ESRI ASCII grid.

    Parameters
    ----------
    path : path
    rows, columns : int
        Size in the header.

    Returns
    -------
    float32 array (Y, X) [m]
        Heights, with fill values as written.

    Raises
    ------
    ValueError
        If the file has more or fewer numbers than the header states, or a word that is not a number.
    """
    count = rows * columns
    with open(path, encoding="ascii", errors="replace") as file:
        file.seek(0, 2)
        if file.tell() < 2 * count:
            raise ValueError(f"the header names {rows} x {columns} nodes, for which the file is too short; it is "
                             "cut off, or its header is wrong.")
        file.seek(0)
        values, filled = np.empty(count, np.float32), 0
        for words in _blocks(file):
            if filled + len(words) > count:
                raise ValueError(f"there are more numbers than the {rows} x {columns} of the header; repair it.")
            try:
                values[filled:filled + len(words)] = words
            except ValueError:
                word = next((word for word in words if not _is_number(word)), "a word")
                raise ValueError(f"the heights contain {word[:40]!r}, which is not a number; repair the file."
                                 ) from None
            filled += len(words)
    if filled < count:
        raise ValueError(f"there are {filled} numbers, and the header names {rows} x {columns}; the file is cut off.")
    return values.reshape(rows, columns)


def _is_number(word):
    try:
        float(word)
    except ValueError:
        return False
    return True


def _blocks(file):
    """Yield the words after the header in blocks of lines."""
    rest = ""
    while (start := file.tell()) >= 0:
        line = file.readline(_LONGEST)
        if (line.split() or [""])[0].lower() not in _KEYS:
            file.seek(start)
            break
    for block in itertools.chain(iter(lambda: file.read(_BLOCK), ""), ("\n",)):
        words = (rest + block).split()
        # The last word may continue in the next block.
        rest = words.pop() if words and not block[-1].isspace() else ""
        if len(rest) > _LONGEST:
            raise ValueError("among the heights is a word without an end; this is no grid.")
        yield words


_HDF5 = HDF5 + b"\r\n\x1a\n"
_HEIGHTS = ("z", "elevation", "depth", "bathymetry", "bathy", "topo", "topography", "height", "altitude", "band1")
DRIVERS = ("GTiff", "BAG", "netCDF", "HDF5", "S102", "AAIGrid", "GRASSASCIIGrid", "XYZ", "ZMap", "ISG", "GSAG", "GSBG",
           "GS7BG", "EHdr", "ENVI", "HFA", "RST", "SAGA", "RRASTER", "PCRaster", "USGSDEM", "DTED", "SRTMHGT", "GRIB",
           "GPKG", "GTX", "NGSGEOID", "BYN", "BT", "Leveller", "Terragen", "HF2", "SIGDEM", "NWT_GRD", "NWT_GRC", "PNG",
           "JPEG", "GIF", "BMP")
_COMPANIONS = (".ovr", ".msk")              # coarser copies and masks, which GDAL opens with any driver
_RASTERS = (*TIFF, b"II+\0", b"MM\0+", b"EHFA")
_stderr = threading.Lock()  # Mitsuba loads shapes in parallel


@contextlib.contextmanager
def opened(path: FilePath, *, spacing: float | None = None, variable: str | None = None, crs: str | None = None,
           resolution: float | None = None, nodata: float | None = None,
           what: str = "bathymetry grid") -> "Iterator[tuple[DatasetReader, CRS | None]]":
    """Open a survey as a raster; an objection of GDAL becomes an error of one sentence.

    Parameters
    ----------
    path : path
    spacing : float [m], optional
        Node distance of an ``.npy`` array, required there and refused for other files.
    variable : str, optional
        Grid of a netCDF file with several grids.
    crs : str, optional
        Coordinate system, if the file does not name it.
    resolution : float [m], optional
        Node distance of the grid of scattered soundings.
    nodata : float, optional
        Depth that marks missing soundings.
    what : str
        Name of the file in error messages.

    Yields
    ------
    raster : rasterio dataset
    source : rasterio.crs.CRS or None
        System of the file's own coordinates. The raster of soundings in degrees or feet has another one, in metres.

    Raises
    ------
    ValueError
        If the file does not exist or cannot be read.
    """
    import rasterio.errors
    from rasterio._err import CPLE_BaseError

    if not os.path.exists(path):
        raise ValueError("there is no such file.")
    if not os.path.isfile(path):
        raise ValueError("it is a folder, a device or a pipe; give a file.")
    if is_of_the_kernel(path):
        raise ValueError("it is a file of the kernel, which may have no end; give another.")
    is_array = str(path).endswith(".npy")
    if is_array != (spacing is not None):
        raise ValueError("an .npy array needs the spacing of its nodes." if is_array else
                         "the file has its own spacing; use resolution for another.")
    with contextlib.ExitStack() as stack:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
                stack.enter_context(_hushed(path))
                if is_array:
                    raster = _array_as_raster(path, spacing)
                elif enc.recognised(path):
                    if crs is not None or nodata is not None:
                        raise ValueError("the file is an electronic chart, whose system is WGS 84 and whose soundings "
                                         "are all depths; leave crs and nodata out.")
                    survey = enc.read(path)
                    yield stack.enter_context(_gridded(survey, resolution)), survey.source
                    return
                elif soundings.holds_soundings(path):
                    raster, source = _soundings_as_raster(path, crs, resolution, nodata)
                    yield stack.enter_context(raster), source
                    return
                elif is_ascii_grid(path):
                    raster = _ascii_as_raster(path)
                else:
                    raster = _by_gdal(path, variable)
            stack.enter_context(raster)
            if variable is not None and raster.driver != "netCDF":
                raise ValueError(f'variable is "{variable}", but only netCDF files hold variables; leave it out.')
            yield raster, source_crs(raster, crs)
        except (rasterio.errors.RasterioError, CPLE_BaseError) as error:    # both of rasterio and of GDAL
            reason = str(error.__cause__ or error).replace(f"'{os.path.abspath(path)}'", "")
            reason = " ".join(reason.split()).rstrip(".")
            raise ValueError(f"this is not a {what} that GDAL can read ({reason}).") from None
        except OSError as error:
            raise ValueError(f"the file cannot be read ({error.strerror or error}).") from None


@contextlib.contextmanager
def _hushed(path):
    """Keep the HDF5 library from printing its stack of errors, which GDAL raises as one exception anyway."""
    if not _is_hdf5(path):
        yield
        return
    with _stderr:
        kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 2)
        try:
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            os.close(nowhere)


def _by_gdal(path, variable):
    import rasterio

    _check_companions(path)
    if _is_hdf5(path):
        _check_hdf5(path)
    raster = _open(path)
    if raster.tags(ns="OVERVIEWS"):
        raster.close()
        raise ValueError("the file names another one for its coarser copies; leave that out (gdaladdo writes copies "
                         "into the file or beside it).")
    if raster.driver == "BAG":
        refined = raster.tags().get("HAS_SUPERGRIDS") == "TRUE"
        raster.close()
        # All refinements at their finest resolution, each interpolated linearly.
        return _open(path, REPORT_VERTCRS="NO", **({"MODE": "INTERPOLATED"} if refined else {}))
    if raster.driver != "netCDF":
        return raster
    _refuse_cut_classic(path)
    # The driver lists no parts if there is only one grid.
    parts = [name.rpartition(":")[2] for name in raster.subdatasets] or \
        [raster.tags(band).get("NETCDF_VARNAME") for band in raster.indexes[:1]]
    raster.close()
    if variable is None and len(parts) > 1:
        likely = [part for part in parts if part.lower() in _HEIGHTS]
        if len(likely) != 1:
            raise ValueError(f"the file holds the grids {', '.join(parts)}; name the one of heights by variable.")
        variable = likely[0]
    if variable is not None and variable not in parts:
        raise ValueError(f'the file holds no grid "{variable}"; it has {", ".join(map(str, parts)) or "none"}.')
    name = f'netcdf:"{path}":{variable}' if variable else path
    # Accept axes whose names or attributes do not follow the conventions.
    return rasterio.open(name, driver="netCDF", IGNORE_XY_AXIS_NAME_CHECKS="YES", ASSUME_LONGLAT="YES")


def _is_hdf5(path):
    """Return True if a file is HDF5, whose first byte may be byte 0, 512, 1024, 2048, ... of the file."""
    with open(path, "rb") as file:
        size, place = file.seek(0, os.SEEK_END), 0
        while place < size:
            file.seek(place)
            if file.read(len(_HDF5)) == _HDF5:
                return True
            place = max(512, 2 * place)
    return False


def _check_hdf5(path):
    """Refuse HDF5 that refers to other files, which GDAL's drivers for BAG and netCDF would follow."""
    try:
        check_hdf5(path)
    except DataElsewhere:
        raise
    except Exception as error:                         # its type depends on where the file is damaged
        raise ValueError(f"the HDF5 file is damaged ({' '.join(str(error).split())}).") from None


def _open(path, **options):
    import rasterio
    from rasterio.io import DatasetReader

    with rasterio.Env():                       # rasterio.open does the same, but takes one driver only
        # absolute path: GDAL takes some relative names for addresses
        return DatasetReader(os.path.abspath(path), driver=list(DRIVERS), **options)


def _check_companions(path):
    folder, name = os.path.split(os.path.abspath(path))
    wanted = {f"{known}{suffix}".lower() for known in (name, os.path.splitext(name)[0]) for suffix in _COMPANIONS}
    for beside in os.listdir(folder):
        if beside.lower() in wanted and os.path.isfile(os.path.join(folder, beside)):
            with open(os.path.join(folder, beside), "rb") as file:
                if not file.read(4).startswith(_RASTERS):
                    raise ValueError(f"{beside}, which lies beside the file, is no raster; remove it.")


def _refuse_cut_classic(path):
    """Refuse a truncated netCDF file of the classic format: the driver reads zeros for missing data."""
    from scipy.io import netcdf_file

    with open(path, "rb") as file:
        if file.read(4) not in CLASSIC[:2]:
            return
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)         # views of the memory map are still in use
            netcdf_file(path, mmap=True).close()                    # places all variables in the file, reads none
    except Exception as error:                                      # its type depends on where the file ends
        raise ValueError(f"the netCDF file is cut off or broken ({' '.join(str(error).split())}).") from None


def _array_as_raster(path, spacing):
    from rasterio.transform import Affine

    try:
        heights = np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, EOFError, OSError, SyntaxError, tokenize.TokenError) as error:
        raise ValueError(f"this is not a NumPy array ({' '.join(str(error).split())}).") from None
    if heights.ndim != 2 or heights.dtype.kind not in "fiu":
        raise ValueError(f"the array is {heights.dtype} of shape {heights.shape}; expected numbers (Y, X).")
    if not 0 < spacing < np.inf:
        raise ValueError(f"spacing is {spacing} m; it must be above 0.")
    check_size(*heights.shape)
    return in_memory(heights, Affine(spacing, 0, -spacing / 2, 0, spacing, -spacing / 2))


def _ascii_as_raster(path):
    _check_companions(path)
    with _open(path) as header:                  # GDAL knows the keys, and a .prj beside the file
        rows, columns = header.shape
        check_size(rows, columns)
        heights = read_values(path, rows, columns)
        return in_memory(heights, header.transform, crs=header.crs, nodata=header.nodata)


def _soundings_as_raster(path, crs, resolution, nodata):
    survey = soundings.read(path, crs=crs, nodata=nodata)
    return _gridded(survey, resolution), survey.source


def _gridded(survey, resolution):
    from rasterio.transform import from_origin

    west, north, step, heights = survey.gridded(resolution)
    return in_memory(heights, from_origin(west - step[0] / 2, north + step[1] / 2, *step), crs=survey.crs)


def in_memory(values: np.ndarray, transform: "Affine", *, crs: "CRS | None" = None,
              nodata: float | None = None) -> "DatasetReader":
    """Return a raster of an array (Y, X), whose rows have the order of ``transform``."""
    from rasterio.io import MemoryFile

    rows, columns = values.shape
    memory = MemoryFile()
    with memory.open(driver="GTiff", height=rows, width=columns, count=1, dtype="float32",
                     nodata=np.nan if nodata is None else nodata, transform=transform, crs=crs) as raster:
        raster.write(np.asarray(values, np.float32), 1)
    return memory.open()


def check_size(rows: int, columns: int) -> None:
    """Check that a grid that must fit into memory has few enough nodes."""
    if rows * columns > MOST_NODES:
        raise ValueError(f"{rows} x {columns} nodes are more than {MOST_NODES:.0e}; make a GeoTIFF of it, of which "
                         "parts can be read.")
