"""The shipped scenes keep their levels: block means against stored ones, judged by their spread.

Every scene is rendered small. Intensities (without speckle and noise) are averaged over pings and over 12 blocks of
range, one value per side and block, and compared with the stored mean of 16 runs. Standard errors come from those
runs; with 24 values a scene, |z| < 5 fails by chance once in 70,000. Scenes with arrays have no chance in them: the
energy of their impulse responses in 12 blocks of time is compared as it is, to 0.01 dB and what float32 sums leave
under the loudest block: 1e-6 of its amplitude, which is all there is before the first echo. Of soundings, the medians
of depth and strength in 12 blocks of beams are, to a centimetre and 0.2 dB. Run with --regenerate after a
change that is meant to move levels.
"""
import json
from pathlib import Path

import numpy as np
import pytest

import mitsonar

SCENES = Path(__file__).resolve().parents[2] / "scenes"
STORED = Path(__file__).with_name("scenes.json")
SMALL = {"pings": 12, "rays": 20_000, "bins": 240, "speckle": False, "noise": False}
COARSE = {"sidescan_wreck": {"bed_spacing": 0.5, "ripple_wavelength": 2.4, "stone_scour": 0}}  # of 2.6 million faces
SMALL_SWATHS = {"pings": 2, "preset": "shallow_400khz"}
SMALL_SIDES = {"pings": 2, "bins": 300}
SMALL_STRIPS = {"pings": 4, "range": 32, "cell": 0.05}
SMALL_ARRAYS = {"elements": 4, "range": 12, "cell": 0.05}
BLOCKS, RUNS = 12, 16
FLOAT32 = 1e-12                    # of a power: what single precision leaves of its amplitude, squared


def scenes_of(sensor):
    """Names of the shipped scenes with a kind of sensor; those of published results have tests of their own."""
    return sorted(path.stem for path in SCENES.glob("*.xml")
                  if f'<sensor type="{sensor}"' in path.read_text() and not path.stem.startswith("published_"))


def known(name, values):
    """Those of some parameters that a scene has."""
    text = (SCENES / f"{name}.xml").read_text()
    return {key: value for key, value in values.items() if f'<default name="{key}"' in text}


def kept(request, name, measure):
    """What is stored of a scene; with --regenerate, what is measured now."""
    stored = json.loads(STORED.read_text()) if STORED.is_file() else {}
    if request.config.getoption("--regenerate"):
        stored[name] = measure()
        STORED.write_text(json.dumps(stored, indent=1, sort_keys=True) + "\n")
    return {key: np.array(value) for key, value in stored[name].items()}


def block_means(scene, seed):
    """Mean level [dB] of each side and range block; -200 where nothing is heard."""
    level = mitsonar.render(scene, seed)["mean_level"].values.astype(float)
    intensity = np.where(level > -199, 10 ** (level / 10), 0)
    blocks = intensity.mean(0).reshape(2, BLOCKS, -1).mean(-1)
    return 10 * np.log10(np.maximum(blocks, 1e-20))


@pytest.mark.parametrize("name", scenes_of("sidescan"))
def test_levels_of_the_shipped_scenes(variant, request, name):
    scene = mitsonar.load_file(SCENES / f"{name}.xml", **known(name, {**SMALL, **COARSE.get(name, {})}))

    def measure():
        runs = np.array([block_means(scene, seed) for seed in range(100, 100 + RUNS)])
        return {"mean": runs.mean(0).round(4).tolist(), "spread": runs.std(0, ddof=1).round(4).tolist()}

    stored = kept(request, name, measure)
    mean, spread = stored["mean"], stored["spread"]
    # the middle one of three runs: a rare bright ghost in one of them moves nothing
    found = np.median([block_means(scene, seed) for seed in (1, 2, 3)], axis=0)
    # the stored spread has 15 degrees of freedom; rounding of a float32 level is 1e-5 dB
    z = (found - mean) / np.hypot(spread * np.sqrt(1 + 1 / RUNS), 2e-3)
    assert np.abs(z).max() < 5.5, f"{name}: levels moved by {np.abs(found - mean).max():.3f} dB"


@pytest.mark.parametrize("name", [*scenes_of("array_sonar"), *scenes_of("forward_looking")])
def test_responses_of_the_shipped_scenes(variant, request, name):
    scene = mitsonar.load_file(SCENES / f"{name}.xml", **known(name, SMALL_ARRAYS))
    energy = (np.abs(mitsonar.impulse_response(scene).values.astype(complex)) ** 2).sum((0, 1, 2))
    blocks = np.array([part.sum() for part in np.array_split(energy, BLOCKS)])
    found = 10 * np.log10(np.maximum(blocks, 1e-30))
    stored = kept(request, name, lambda: {"energy": found.round(4).tolist()})["energy"]
    found, stored = 10 ** (found / 10), 10 ** (stored / 10)
    assert np.all(np.abs(found - stored) < 0.0023 * stored + FLOAT32 * stored.max())        # 0.0023: 0.01 dB


@pytest.mark.parametrize("name", scenes_of("synthetic_aperture"))
def test_images_of_the_shipped_strips(variant, request, name):
    """Without noise a strip has no chance in it: mean powers of 12 blocks across the track, to 0.01 dB."""
    image = mitsonar.render(mitsonar.load_file(SCENES / f"{name}.xml", **known(name, {**SMALL_STRIPS, "noise": False})))
    power = (np.abs(image["image"].values.astype(complex)) ** 2).mean((0, 1))
    found = 10 * np.log10(np.maximum([part.mean() for part in np.array_split(power, BLOCKS)], 1e-30))
    stored = kept(request, name, lambda: {"level": found.round(4).tolist()})["level"]
    assert np.abs(found - stored).max() < 0.01


@pytest.mark.parametrize("name", [*scenes_of("multibeam"), *scenes_of("interferometric")])
def test_soundings_of_the_shipped_scenes(variant, request, name):
    small = known(name, SMALL_SWATHS if name in scenes_of("multibeam") else SMALL_SIDES)
    line = mitsonar.soundings(mitsonar.load_file(SCENES / f"{name}.xml", **small), seed=5)
    # a block without soundings, as of a water column, is 0
    found = {measure: np.array([np.median(part[np.isfinite(part)]) if np.isfinite(part).any() else 0.0
                                for part in np.array_split(line[measure].values, BLOCKS, axis=1)])
             for measure in ("depth", "backscatter_db")}
    stored = kept(request, name, lambda: {key: value.round(4).tolist() for key, value in found.items()})
    assert np.abs(found["depth"] - stored["depth"]).max() < 0.01
    assert np.abs(found["backscatter_db"] - stored["backscatter_db"]).max() < 0.2
