"""Make the pictures of the tutorials: ``python docs/tutorial_pictures.py FOLDER``.

``FOLDER`` holds one folder for each tutorial, called after its page, in which that page has
been followed to its end: ``FOLDER/own-step/pin`` and so on.  Pages that are not there are left out.
"""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from klack.analyses.calibration.analysis import CALIBRATION
from klack.analyses.calibration.content import stroke_chart as calibration_chart
from klack.analyses.impact.analysis import IMPACT
from klack.analyses.impact.figures import force_chart, spectrum_chart
from klack.analyses.stroke.analysis import STROKE
from klack.analyses.stroke.figures import actuation_chart
from klack.mesh.mesh import Mesh
from klack.mesh.sizing import MeshSizing
from klack.mesh.solid import mesh_step
from klack.report.printed import STYLE, svg, svg_chart

IMAGES = Path(__file__).parent / "images"


def main(folder: Path) -> None:
    """Write the pictures of every tutorial that was followed."""
    for page, draw in PAGES.items():
        if (folder / page).is_dir():
            for name, image in draw(folder / page).items():
                (IMAGES / f"tutorial-{name}.svg").write_bytes(image)
                print(f"tutorial-{name}.svg: {len(image) / 1e3:.0f} kB")


def own_step(folder: Path) -> dict[str, bytes]:
    """Both parts, and the force of the pin."""
    with rc_context(STYLE):
        figure = Figure(figsize=(5.0, 3.6))
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), projection="3d")
        for name, colour, places in (
            ("pin", "#8fb3d9", PIN_WORDS),
            ("plate", "#c9ced6", PLATE_WORDS),
        ):
            _draw_part(axes, mesh_step(folder / f"{name}.step", MeshSizing(size=0.5e-3)), colour)
            for word, place in places:
                axes.text(*place, word, fontsize=8, color="black", zorder=10)
        axes.set(xlim=(-5, 5), ylim=(-5, 5), zlim=(-2, 12))
        axes.set_box_aspect((10, 10, 14), zoom=1.05)
        axes.view_init(elev=22, azim=-60)
        axes.set_axis_off()
        parts = svg(figure, dpi=150)
    study = IMPACT.load(folder / "pin")
    return {"pin-parts": parts, "pin-force": svg_chart(force_chart(study))}


PIN_WORDS = (("tip", (-2.6, 0, 0.2)), ("flat", (1.9, 0, 6.0)), ("shaft", (-3.6, 0, 10.0)))
PLATE_WORDS = (("seat", (-4.2, 0, 0.3)), ("rim", (4.4, -4.4, -1.4)), ("hole", (2.6, 0, 0.6)))


def _draw_part(axes: Any, mesh: Mesh, colour: str) -> None:
    """Outer triangles of a mesh [mm], lit from one side."""
    faces = [block.connectivity[:, :3] for s in mesh.surfaces.values() for block in s.blocks]
    triangles = 1e3 * mesh.points[np.concatenate(faces)]
    shown = Poly3DCollection(triangles, shade=True, facecolors=colour, rasterized=True)
    axes.add_collection3d(shown)


def own_inp(folder: Path) -> dict[str, bytes]:
    """Force of the plunger."""
    return {"plunger-force": svg_chart(force_chart(IMPACT.load(folder / "plunger")))}


def dry_impact(folder: Path) -> dict[str, bytes]:
    """Force of all levels; spectrum without the lumped one."""
    study = IMPACT.load(folder / "fine")
    flexible = replace(study, levels={k: v for k, v in study.levels.items() if k != "lumped"})
    return {
        "dry-force": svg_chart(force_chart(study)),
        "dry-spectrum": svg_chart(spectrum_chart(flexible)),
    }


def wet_stroke(folder: Path) -> dict[str, bytes]:
    """Current, magnetic force and lift, wet and dry."""
    whole = actuation_chart(STROKE.load(folder / "stroke"))
    kept = [panel for panel in whole.panels if panel.y.label in ("current", "magnet", "lift")]
    first = kept[0]
    top = max(float(curve.y.max()) for curve in first.curves)
    axis = replace(first.y, range=(-0.05 * top, 1.4 * top))  # with room for the words of the marks
    kept[0] = replace(first, y=axis, marks=whole.panels[0].marks)
    return {"stroke": svg_chart(replace(whole, panels=tuple(kept)))}


def measurement(folder: Path) -> dict[str, bytes]:
    """Lift before and after the fit."""
    study = CALIBRATION.load(folder / "fit")
    return {"fit": svg_chart(calibration_chart(study, study.channels[0]))}


def system_tool(folder: Path) -> dict[str, bytes]:
    """Force of klack and of the FMU."""
    from fmpy import simulate_fmu

    history = IMPACT.load(folder / "disc").levels["reduced"].history
    time, force = history.time, history.force
    run = simulate_fmu(
        str(folder / "models" / "disc_pair.fmu"),
        stop_time=40e-6,
        output_interval=0.2e-6,
        start_values={"start_velocity": -0.3, "internal_step": 20e-9},
        output=["contact_force"],
    )
    with rc_context(STYLE):
        figure = Figure(figsize=(6.7, 2.6), layout="constrained")
        axes = figure.add_subplot()
        axes.plot(1e6 * time, force, color="black", lw=1.2, label="klack")
        axes.plot(
            1e6 * run["time"],
            run["contact_force"],
            "o",
            ms=3,
            mfc="none",
            color="#c2410c",
            label="FMU in FMPy, every 0.2 us",
        )
        axes.set(xlim=(0, 8), xlabel="time [us]", ylabel="contact force [N]")
        axes.legend(loc="upper right")
        return {"disc-fmu": svg(figure)}


def quieter_design(folder: Path) -> dict[str, bytes]:
    """Third octaves of the contact force, first and last design."""
    with rc_context(STYLE):
        figure = Figure(figsize=(6.7, 2.8), layout="constrained")
        axes = figure.add_subplot()
        for name, colour, dash in (("base", "black", "-"), ("quiet", "#c2410c", "--")):
            octaves = _third_octaves(folder / f"{name}-noise.json")
            x, y = octaves[:, 0] / 1e3, octaves[:, 1]
            axes.step(x, y, dash, where="mid", color=colour, label=name)
        axes.set_xscale("log")
        axes.set(xlim=(0.1, 200), xlabel="frequency [kHz]", ylabel="third octave of the force [dB]")
        axes.legend()
        return {"quieter": svg(figure)}


def classical_chain(folder: Path) -> dict[str, bytes]:
    """Transfer function to one node, force and spectrum; the section is that of the README."""
    study = IMPACT.load(folder / "impact")
    return {
        "chain-node": (folder / "reduce" / "needle.node.svg").read_bytes(),
        "chain-force": svg_chart(force_chart(study)),
        "chain-spectrum": svg_chart(spectrum_chart(study)),
    }


def _third_octaves(path: Path) -> np.ndarray:
    """Centre frequencies [Hz] and levels [dB]."""
    rows = json.loads(path.read_text(encoding="utf-8"))["third_octave"]
    return np.array([(row["center_Hz"], row["level_dB"]) for row in rows])


def stairs(folder: Path) -> dict[str, bytes]:
    """Lift and velocity, wet, dry and of the synthetic record, with the echo times."""
    record = np.loadtxt(folder / "record_synthetic.csv", delimiter=",", skiprows=3)
    study = STROKE.load(folder / "stairs")
    wet = study.variants["wet"]
    with rc_context(STYLE):
        figure = Figure(figsize=(6.7, 4.6), layout="constrained")
        lift, speed = figure.subplots(2, 1, sharex=True)
        for axes, column, name, scale in (
            (lift, 1, "needle.tip displacement", 1e6),
            (speed, 2, "needle velocity", 1.0),
        ):
            axes.plot(record[:, 0], record[:, column], color="#9db4d6", lw=2.2,
                      label="recorded (synthetic), wet")  # fmt: skip
            for label, colour, dash in (("wet", "black", "-"), ("dry", "#c2410c", ":")):
                result = study.variants[label].result
                values = result.channels[name].values
                axes.plot(1e3 * result.time, scale * (values - values[0]), dash, color=colour,
                          lw=1.1, label=f"computed, {label}")  # fmt: skip
            for impact, count in zip(wet.impacts("seat"), (4, 3), strict=False):
                middle = impact.time + 0.5 * impact.contact_time
                for k in range(1, count):
                    axes.axvline(1e3 * (middle + k * ECHO), color="#3b6fb5", lw=0.8, ls="--",
                                 label="" if k > 1 or count < 4 else "impact + k 2L/a")  # fmt: skip
        lift.set(ylabel="lift [um]", xlim=(1.5, 2.7))
        speed.set(ylabel="velocity [m/s]", xlabel="time [ms]", ylim=(-0.75, 0.75))
        figure.legend(*speed.get_legend_handles_labels(), loc="outside lower center", ncols=4)
        return {"stairs": svg(figure)}


ECHO = 104.08e-6  # [s], 2 L / a of the case stairs

PAGES = {
    "own-step": own_step,
    "own-inp": own_inp,
    "dry-impact": dry_impact,
    "wet-stroke": wet_stroke,
    "measurement": measurement,
    "system-tool": system_tool,
    "quieter-design": quieter_design,
    "stairs": stairs,
    "classical-chain": classical_chain,
}

if __name__ == "__main__":
    main(Path(sys.argv[1]))
