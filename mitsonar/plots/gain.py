"""Time-varied gain for display: what a sonar adds so that an even seabed looks even. The data are never changed.

    target   40 log R + 2 a R                         two-way spherical spreading and absorption
    seabed   30 log R + 2 a R - 20 log sin(grazing)   the ensonified area grows with R; Lambert's law falls with sin²

R -> ``range`` [m], a -> ``absorption_db`` [dB/m]; sin(grazing) = altitude / R, the bed taken as level, where the
altitude is known. The pattern of the beam is not divided out.
"""
import numpy as np

LOWEST_SINE = np.sin(np.deg2rad(1.0))  # below 1 degree there is no echo to restore, only noise to raise


def display_gain(dataset, tvg):
    """Give the gain to add to the levels of a picture, and its formula in words.

    Parameters
    ----------
    dataset : xarray.Dataset
        With the coordinate range and, where known, altitude(ping) and the attribute absorption_db.
    tvg : {'seabed', 'target', None}

    Returns
    -------
    gain : array (P or 1, N) [dB]
    words : str
        To be put after 'level'; empty without gain.

    Raises
    ------
    ValueError
        If ``tvg`` is none of these.
    """
    slant_range = np.maximum(np.asarray(dataset["range"].values, float), 1e-3)[None]
    absorption = 2 * float(dataset.attrs.get("absorption_db") or 0) * slant_range
    if tvg is None:
        return np.zeros_like(slant_range), ""
    if tvg == "target":
        return 40 * np.log10(slant_range) + absorption, " + 40 log R + 2αR"
    if tvg != "seabed":
        raise ValueError(f"the display gain is {tvg!r}; use 'seabed', 'target' or None.")
    gain = 30 * np.log10(slant_range) + absorption
    if "altitude" not in dataset.coords:
        return gain, " + 30 log R + 2αR"
    altitude = np.asarray(dataset["altitude"].values, float).reshape(-1, 1)
    sine = np.clip(np.where(np.isfinite(altitude), altitude, np.inf) / slant_range, LOWEST_SINE, 1)
    return gain - 20 * np.log10(sine), " + 30 log R + 2αR − 20 log sin θ"
