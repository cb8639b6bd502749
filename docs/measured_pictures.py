"""Make the pictures of the page of measured comparisons: ``python docs/measured_pictures.py``.

From the six shots of the case ``struck-bar``, with and without the dome on the striker's end, come
struck-bar.svg and struck-bar-ends.svg; alumina.svg from the oblique impacts of spheres;
bounce-in-liquid.svg and rebounds-in-oil.svg from bounces of spheres on a wall in a liquid;
ball-on-rock.svg from the waves of a ball on rock; pole-in-yoke.svg from a magnet.
"""

from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from klack.report.chart import COLOURS
from klack.report.printed import STYLE, svg
from klack.verification.ball_on_rock import computed_pulse, steep_pulses
from klack.verification.half_space import oblique_spheres
from klack.verification.measured import SHOTS, struck_bar
from klack.verification.pole_in_yoke import FIELD, MEASURED, network_points
from klack.verification.sphere_in_liquid import (
    GLASS,
    NYLON,
    REBOUNDS,
    ROUGHNESS,
    STEEL,
    STOKES_NUMBERS,
    film_alone,
    measured_ratio,
    rebounds,
    restitution,
)

IMAGES = Path(__file__).parent / "images"


def main() -> None:
    """Compute all shots and draw them."""
    with rc_context(STYLE):
        for name, figure in figures().items():
            (IMAGES / name).write_bytes(svg(figure))


def figures() -> dict[str, Figure]:
    """Both pictures, by the names of their files."""
    whole = Figure(figsize=(9.0, 5.6), layout="constrained")
    near = Figure(figsize=(9.0, 5.6), layout="constrained")
    for k, shot in enumerate(SHOTS):
        domed, flat = struck_bar(shot), struck_bar(shot, flat=True)
        pulse = domed.pulses[0]
        for figure in (whole, near):
            axes = figure.add_subplot(2, 3, k + 1)
            time = 1e6 * domed.time
            level = pulse.computed.plateau
            axes.plot(time, domed.middle / level, color=COLOURS["blue"], lw=1.6)
            axes.plot(1e6 * flat.time, flat.computed / flat.pulses[0].computed.plateau,
                      color=COLOURS["orange"], lw=1.1, ls=":")  # fmt: skip
            axes.plot(time, domed.computed / level, color=COLOURS["black"], lw=1.1, ls="--")
            axes.set_title(f"{shot.name}: {shot.striker} mm, {shot.speed:g} m/s")
            axes.grid(visible=True, color="#dddddd", lw=0.5)
            if k > 2:
                axes.set_xlabel("time since the front [us]")
            if k % 3 == 0:
                axes.set_ylabel("strain over plateau")
        end = 1e6 * pulse.measured.length
        near.axes[k].set_xlim(end - 28.0, end + 28.0)
        near.axes[k].set_ylim(-0.15, 1.2)
    labels = ("measured", "computed, flat faces", "computed, dome of 0.12 mm")
    for figure in (whole, near):
        figure.legend(figure.axes[0].lines, labels, loc="outside lower center", ncols=3)
    return {
        "struck-bar.svg": whole,
        "struck-bar-ends.svg": near,
        "alumina.svg": alumina(),
        "bounce-in-liquid.svg": bounce_in_liquid(),
        "rebounds-in-oil.svg": rebounds_in_oil(),
        "ball-on-rock.svg": ball_on_rock(),
        "pole-in-yoke.svg": pole_in_yoke(),
    }


def alumina() -> Figure:
    """Tangential restitution of alumina on glass over the angle of incidence."""
    curve = next(check.curve for check in oblique_spheres() if check.curve is not None)
    figure = Figure(figsize=(5.4, 3.2), layout="constrained")
    axes = figure.add_subplot()
    axes.plot(*curve.expected, "o", color=COLOURS["blue"], ms=4, label="measured")
    axes.plot(*curve.computed, color=COLOURS["black"], lw=1.2, ls="--", label="computed")
    axes.set(xlabel=curve.x_label, ylabel=curve.y_label, ylim=(0.5, 1.0))
    axes.grid(visible=True, color="#dddddd", lw=0.5)
    axes.legend()
    return figure


def bounce_in_liquid() -> Figure:
    """Restitution of spheres on a wall in a liquid over their Stokes number."""
    figure = Figure(figsize=(6.4, 3.6), layout="constrained")
    axes = figure.add_subplot()
    fine = np.geomspace(5.0, 3000.0, 200)
    axes.semilogx(fine, [measured_ratio(x) for x in fine], color=COLOURS["blue"], lw=2.4,
                  label="measured: fit exp(-35/St)")  # fmt: skip
    axes.semilogx(fine, [film_alone(x, 3.0 * ROUGHNESS) for x in fine], color=COLOURS["black"],
                  lw=1.0, ls=":", label="computed, film alone")  # fmt: skip
    shapes = ((STEEL, "o", "black"), (GLASS, "s", "orange"), (NYLON, "^", "green"))
    for sphere, marker, colour in shapes:
        values = [restitution(sphere, x, drag=True) for x in STOKES_NUMBERS]
        axes.semilogx(STOKES_NUMBERS, values, marker, color=COLOURS[colour], ms=4.5, mfc="none",
                      label=f"computed, film and drag: {sphere.name}")  # fmt: skip
    axes.set(xlabel="Stokes number", ylabel="restitution, wet over dry", ylim=(-0.03, 1.03))
    axes.grid(visible=True, which="both", color="#dddddd", lw=0.5)
    axes.legend(loc="lower right", fontsize=8)
    return figure


def rebounds_in_oil() -> Figure:
    """Height over time of two spheres that bounce in silicone oil."""
    figure = Figure(figsize=(9.0, 3.4), layout="constrained")
    kinds = (
        ("without memory", {"memory": False}, "orange", ":"),
        ("memory of Mei and Adrian", {"typical_speed": 0.5}, "green", "-."),
        ("memory of Basset", {}, "black", "--"),
    )
    for k, shot in enumerate(REBOUNDS):
        axes = figure.add_subplot(1, 2, k + 1)
        for label, keys, colour, line in kinds:
            course, _, _ = rebounds(shot, **keys)
            axes.plot(1e3 * course[0], 1e3 * course[1], line, color=COLOURS[colour], lw=1.2,
                      label=f"computed, {label}")  # fmt: skip
        time, height = (*shot.tops, 0.0, *shot.contacts), shot.heights
        height = (*height, *[0.0] * (1 + len(shot.contacts)))
        axes.plot(1e3 * np.array(time), 1e3 * np.array(height), "o", color=COLOURS["blue"],
                  ms=5, label="measured")  # fmt: skip
        end = 1.3e3 * shot.contacts[-1]
        axes.set(xlabel="time since the first contact [ms]", xlim=(-3.0, end), ylim=(-0.3, None),
                 title=f"Stokes number {shot.stokes:g}")  # fmt: skip
        axes.grid(visible=True, color="#dddddd", lw=0.5)
    figure.axes[0].set_ylabel("height [mm]")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def ball_on_rock() -> Figure:
    """Surface velocity over time, over its first extreme."""
    figure = Figure(figsize=(6.4, 3.4), layout="constrained")
    axes = figure.add_subplot()
    steep = steep_pulses()
    shapes = np.array([one.shape for one in steep])
    time = 1e6 * steep[0].time
    axes.plot(time, shapes.mean(axis=0), color=COLOURS["blue"], lw=2.0,
              label=f"measured, mean of {len(steep)} places")  # fmt: skip
    axes.fill_between(time, *np.percentile(shapes, [10, 90], axis=0), color=COLOURS["blue"],
                      alpha=0.25, lw=0, label="80 % of them")  # fmt: skip
    pulse = computed_pulse()
    seen = slice(None, None, 5)
    axes.plot(1e6 * pulse.time[seen], pulse.shape[seen],
              color=COLOURS["black"], lw=1.3, ls="--", label="computed")  # fmt: skip
    axes.set(xlabel="time since the P wave [us]", xlim=(-1.0, 8.0), ylim=(-0.9, 1.1),
             ylabel="velocity over its first extreme")  # fmt: skip
    axes.grid(visible=True, color="#dddddd", lw=0.5)
    axes.legend()
    return figure


def pole_in_yoke() -> Figure:
    """Force on a pole and flux densities along it over the ampere turns of its coil."""
    figure = Figure(figsize=(9.0, 3.4), layout="constrained")
    force, flux = figure.subplots(1, 2)
    kinds = (
        ("measured", MEASURED, "blue", "o"),
        ("finite elements in space", FIELD, "black", "-"),
        ("klack's network, from the drawing", network_points(), "orange", "--"),
    )
    for label, points, colour, line in kinds:
        turns = [one.ampere_turns for one in points]
        style = {"color": COLOURS[colour], "lw": 1.3, "ms": 5, "label": label}
        force.plot(turns, [one.force for one in points], line, **style)
        for name in ("gap", "pole", "yoke"):
            flux.plot(turns, [getattr(one, name) for one in points], line, **style)
    for name in ("gap", "pole", "yoke"):
        flux.text(5080.0, getattr(MEASURED[-1], name), name, va="center")
    flux.set_xlim(700.0, 5700.0)
    force.set_ylabel("force [N]")
    flux.set_ylabel("flux density [T]")
    for axes in (force, flux):
        axes.set_xlabel("ampere turns")
        axes.set_ylim(0.0, None)
        axes.grid(visible=True, color="#dddddd", lw=0.5)
    figure.legend(*force.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


if __name__ == "__main__":
    main()
