"""What benchmarks of inversions share: tracks that are some centimetres off, speckled images, beds 1 dB too strong."""
import numpy as np

NAVIGATION, LEVEL_DB = 0.05, 1.0     # [m], [dB] that models are off by


def jittered(places, heading_deg, ping_rate, path, seed):
    """Write a track about places (pings, 3) that is off by 5 cm a direction, alike over some 10 pings."""
    from scipy.ndimage import gaussian_filter1d

    count = len(places)
    chance = np.random.default_rng(seed).standard_normal((max(4 * count, 20), 3))       # of few it would hardly vary
    off = gaussian_filter1d(chance, 4, axis=0, mode="wrap")
    off = (NAVIGATION * off / off.std(0))[:count]
    angles = np.column_stack([np.zeros((count, 2)), np.full(count, heading_deg)])
    way = np.column_stack((np.arange(count) / ping_rate, places + off, angles))
    np.savetxt(path, way, delimiter=",", header="time,x,y,z,roll,pitch,heading", comments="", fmt="%.5f")


def stronger(parameters, key, level_db=LEVEL_DB):
    """Make a strength of a scene so much stronger."""
    parameters[key] = parameters[key] * 10 ** (level_db / 10)


def looked(scene, looks, seed=700):
    """An image that is the mean of draws of speckle; its rays are none of the model's."""
    import mitsonar

    images = [mitsonar.render(scene, seed=seed + look) for look in range(looks)]
    mean = np.mean([10 ** (image["level"].values.astype(float) / 10) for image in images], 0)
    return images[0].assign(level=(images[0]["level"].dims, 10 * np.log10(mean)))


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))
