"""Gradients of a sidescan's record: their time over that of the record, and each parameter against differences.

    python tests/benchmarks/gradients.py [--rays 250000] [--pings 8] [--rounds 3] [--check]

The record is `mitsonar.render`, truth and speckle and all; the field is what gradients are of, traced and summed. With
hits kept, products are J v and Jᵀ w about one place; a whole gradient traces, follows outlines, and goes backward once.
"""
import argparse
import tempfile
from pathlib import Path

import measuring
import numpy as np

import mitsonar

WATERS = {"uniform": '<float name="sound_speed" value="1500"/>',
          "thermocline": '<string name="profile" value="0:1492, 18:1490, 24:1478, 30:1474, 50:1474"/>'}
HEIGHTS = "bed.vertex_positions"
SCENE = """<scene version="3.0.0">
    <integrator type="sonar_path"><integer name="rays" value="{rays}"/></integrator>
    <shape type="seabed" id="bed">
        <float name="depth" value="30"/> <float name="length" value="60"/> <float name="width" value="80"/>
        <float name="spacing" value="1"/> <float name="sine_wavelength" value="16"/>
        <float name="sine_height" value="0.4"/> <float name="sine_heading_deg" value="70"/>
        <bsdf type="lambert"><float name="mu_db" value="-25"/></bsdf>
    </shape>
    <sensor type="sidescan" id="sonar">
        <integer name="pings" value="{pings}"/> <point name="start" x="0" y="-4" z="-16"/>
        <float name="speed_knots" value="3"/> <medium type="seawater">{water}</medium>
        <film type="sonar_film"><float name="range" value="34"/> <integer name="bins" value="200"/></film>
    </sensor>
</scene>"""


def loaded(water, rays, pings):
    """The scene, of a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.xml"
        path.write_text(SCENE.format(water=WATERS[water], rays=rays, pings=pings), encoding="utf-8")
        return mitsonar.load_file(path)


def costs(water, rays, pings, count):
    """Seconds of all that is done about a place, in interleaved rounds."""
    scene = loaded(water, rays, pings)
    model, lit = (mitsonar.scene_model(scene, [HEIGHTS], edges=edges) for edges in (True, False))
    about = lit.linearised({})
    weights = np.ones_like(about.value)
    lifted = np.zeros_like(model.start[HEIGHTS])
    lifted[:, 2] = 1
    return measuring.rounds({
        "the record": lambda: mitsonar.render(scene),
        "the field, traced": lambda: lit.value({}),
        "J v, hits kept": lambda: about.forward({HEIGHTS: lifted}),
        "Jt w, hits kept": lambda: about.backward(weights),
        "a whole gradient of what is lit": lambda: lit.linearised({}).backward(weights),
        "a whole gradient, outlines too": lambda: model.linearised({}).backward(weights)}, count)


def main():
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rays", type=int, default=250_000, help="per ping")
    parser.add_argument("--pings", type=int, default=8)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--check", action="store_true", help="compare each parameter with differences, too")
    options = parser.parse_args()
    import mitsuba as mi

    mi.set_variant("llvm_ad_mono")
    print(measuring.machine())
    print("| water | what | CPU [s] | over the record | over the field |\n|---|---|---|---|---|")
    for water in WATERS:
        found = costs(water, options.rays, options.pings, options.rounds)
        cpu = {name: float(np.median(cost.cpu)) for name, cost in found.items()}
        for name, seconds in cpu.items():
            print(f"| {water} | {name} | {seconds:.3f} | {seconds / cpu['the record']:.2f} | "
                  f"{seconds / cpu['the field, traced']:.2f} |", flush=True)
    if options.check:
        print("| water | parameter | verdict | off differences | forward and backward |\n|---|---|---|---|---|")
        for water in WATERS:
            for row in mitsonar.gradient_check(loaded(water, options.rays, options.pings)).rows:
                print(f"| {water} | {row.key} {row.part} | {row.verdict} | {row.error:.1e} | {row.asymmetry:.1e} |",
                      flush=True)


if __name__ == "__main__":
    main()
