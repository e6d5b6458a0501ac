"""A sidescan's mean over pings, with its standard error."""
import numpy as np
import xarray as xr

import mitsonar


def render(scene, seed: int = 0) -> tuple[xr.Dataset, np.ndarray, np.ndarray]:
    """`mitsonar.render`, and the mean intensity over pings, (side, bin) [µPa²], with its standard error."""
    dataset = mitsonar.render(scene, seed)
    intensity = 10 ** (dataset["mean_level"].values.astype(float) / 10)
    return dataset, intensity.mean(0), intensity.std(0, ddof=1) / np.sqrt(len(intensity))
