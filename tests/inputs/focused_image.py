"""A focused image made of nothing but numbers: speckle, a point and its shadow on a turned grid."""
import numpy as np
import xarray as xr

from mitsonar.synthetic_aperture.record import check_image


def focused_image(rows: int = 20, columns: int = 30, *, banks: int = 2, heading: float = 0.3, spacing: float = 0.05,
                  seed: int = 0) -> xr.Dataset:
    """Return an image whose grid begins 10 m abeam, with its truth, and the interferogram of two banks."""
    rng = np.random.default_rng(seed)
    along, across = spacing * np.arange(rows), 10 + spacing * np.arange(columns)
    image = rng.normal(size=(banks, rows, columns)) + 1j * rng.normal(size=(banks, rows, columns))
    shadow = np.zeros((rows, columns), np.float32)
    shadow[rows // 2, columns // 2:] = 1
    image = (0.01 * image * (1 - 0.9 * shadow)).astype(np.complex64)
    image[:, rows // 2, columns // 2] = 1
    ground, dims = ("along_track", "across_track"), ("bank", "along_track", "across_track")
    ahead, abeam = np.array([np.sin(heading), np.cos(heading)]), np.array([np.cos(heading), -np.sin(heading)])
    place = along[:, None, None] * ahead + across[:, None] * abeam
    record = xr.Dataset({
        "image": (dims, image, {"units": "m", "long_name": "complex strength"}),
        "level": (dims, (20 * np.log10(np.abs(image))).astype(np.float32), {"units": "dB re 1 m²"}),
        "x": (ground, 3 + place[..., 0], {"units": "m"}), "y": (ground, -2 + place[..., 1], {"units": "m"}),
        "grid_depth": (ground, np.full((rows, columns), 15, np.float32), {"units": "m"}),
        "label": (ground, (1 + (shadow > 0)).astype(np.int32), {"units": "1"}),
        "shadow": (ground, shadow, {"units": "1"}),
        **{name: (ground, np.full((rows, columns), 15, np.float32), {"units": "m"})
           for name in ("depth", "seabed_depth")}},
        coords={"along_track": ("along_track", along, {"units": "m"}),
                "across_track": ("across_track", across, {"units": "m"})},
        attrs={"sonar": "synthetic_aperture", "frequency": 3e5, "seed": seed, "crs": "EPSG:32632", "altered": None,
               "local_origin": [500000.0, 6000000.0], "labels": {"1": "bed", "2": "mine"}, "parameters": {}})
    if banks > 1:
        phase = np.angle(image[0] * image[1].conj())
        record["phase"] = (ground, phase.astype(np.float32), {"units": "rad"})
        record["coherence"] = (ground, np.cos(phase / 4).astype(np.float32), {"units": "1"})
        record["height"] = (ground, (0.1 * phase).astype(np.float32), {"units": "m"})
    check_image(record)
    return record
