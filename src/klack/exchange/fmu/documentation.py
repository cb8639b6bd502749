"""Pages and pictures inside an FMU."""

from collections.abc import Sequence
from importlib.resources import files
from io import BytesIO
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from numpy.typing import NDArray

from klack.contact.laws import HertzLaw, HuntCrossley, LinearLaw, TableLaw
from klack.exchange.fmu.model_description import communication_step, supports_model_exchange
from klack.exchange.fmu.variables import fmu_variables
from klack.exchange.modal_model import ModalModel, ModelContact
from klack.network.protocols import InterfaceLaw

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["documentation_files", "receptance"]


_STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8.0,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e3e6ea",
    "grid.linewidth": 0.5,
    "legend.frameon": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "klack",
}
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_DASHES = ("-", "--", "-.", ":")
_BLUE, _GREY = "#0072B2", "#8A8F98"
_POINTS = 1200


def port_picture(model: ModalModel, outputs: Sequence[str]) -> bytes:
    """SVG: inputs left of a block, outputs right."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    inputs = [item.name for item in model.inputs]
    rows = max(len(inputs), len(outputs), 2)
    with rc_context(_STYLE):
        figure = Figure(figsize=(6.7, 0.5 + 0.24 * rows))
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set(xlim=(0.0, 10.0), ylim=(-0.8, rows + 0.3))
        axes.axis("off")
        axes.add_patch(
            Rectangle((3.4, -0.4), 3.2, rows + 0.3, facecolor="#f4f6f8", edgecolor="#111111")
        )
        words = f"{model.name}\n{model.mode_count} modes"
        axes.text(5.0, 0.5 * rows - 0.25, words, ha="center", va="center", fontsize=8)
        for names, tail, head, side in ((inputs, 2.9, 3.4, "right"), (outputs, 6.6, 7.1, "left")):
            for i, name in enumerate(names):
                y = rows - 0.5 - (i + 0.5) * rows / len(names) + 0.25
                arrow = {"arrowstyle": "-|>", "color": _BLUE, "shrinkA": 0, "shrinkB": 0}
                axes.annotate("", (head, y), (tail, y), arrowprops=arrow)
                x = tail - 0.1 if side == "right" else head + 0.1
                axes.text(x, y, name, ha=side, va="center", family="monospace", fontsize=7)
        return _svg(figure)


def answer_picture(model: ModalModel) -> bytes:
    """SVG: receptances of a body, or contact laws of a pair."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(_STYLE):
        figure = Figure(figsize=(6.7, 2.8), layout="constrained")
        axes = figure.subplots()
        (_draw_laws if model.kind == "pair" else _draw_receptances)(axes, model)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize=7)
        return _svg(figure)


def receptance(model: ModalModel, output: int, source: int, f: NDArray[np.float64]) -> NDArray[Any]:
    r"""Displacement per force [m/N] at frequencies ``f`` [Hz].

    .. math:: H = \sum_i \frac{c_i b_i}{\omega_i^2 - \omega^2 + 2 j \zeta_i \omega_i \omega}
    """
    w = 2.0 * np.pi * f[:, None]
    shares = np.asarray(model.outputs[output].shape) * np.asarray(model.inputs[source].shape)
    below = model.omega**2 - w**2 + 2j * model.damping * model.omega * w
    return np.asarray((shares / below).sum(axis=1))


def icon() -> bytes:
    """PNG of 100 x 100 points: a ball above its seat."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle, FancyArrow, Polygon

    figure = Figure(figsize=(1.0, 1.0), dpi=100)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0, 100), ylim=(0, 100))
    axes.axis("off")
    axes.add_patch(
        Polygon(
            [(8, 8), (92, 8), (92, 40), (68, 40), (50, 22), (32, 40), (8, 40)],
            facecolor=_GREY,
            edgecolor="#111111",
        )
    )
    axes.add_patch(Circle((50, 52), 18, facecolor=_BLUE, edgecolor="#111111"))
    axes.add_patch(
        FancyArrow(
            50,
            95,
            0,
            -12,
            width=4,
            head_width=12,
            head_length=9,
            facecolor="#D55E00",
            edgecolor="none",
        )
    )
    FigureCanvasAgg(figure)
    stream = BytesIO()
    figure.savefig(stream, format="png", metadata={"Software": "klack"})
    return stream.getvalue()


def _draw_receptances(axes: "Axes", model: ModalModel) -> None:
    elastic = model.frequencies[model.frequencies > 0.0]
    top = float(elastic.max()) if elastic.size else 1e5
    low = 0.1 * float(elastic.min()) if elastic.size else 1e3
    f = np.geomspace(low, 1.2 * top, _POINTS)
    for i, source in enumerate(model.inputs):
        port = source.name.removeprefix("force_")
        same = [
            o
            for o, output in enumerate(model.outputs)
            if output.quantity == "displacement" and np.array_equal(output.shape, source.shape)
        ]
        if same:
            size = np.abs(receptance(model, same[0], i, f))
            axes.loglog(
                1e-3 * f, 1e9 * size, _DASHES[i % 4], color=_COLOURS[i % 6], lw=1.2, label=port
            )
    axes.axvline(1e-3 * top, color=_GREY, lw=0.8)
    axes.set(xlabel="frequency [kHz]", ylabel="displacement per force [nm/N]")


def _draw_laws(axes: "Axes", model: ModalModel) -> None:
    for i, contact in enumerate(model.contacts):
        if contact.law is None:
            continue
        d = np.linspace(0.0, _deepest(model, i), 200)
        force = contact.law.force(d)
        way = d + contact.series_compliance * force
        axes.plot(
            1e6 * way, force, _DASHES[i % 4], color=_COLOURS[i % 6], lw=1.5, label=contact.name
        )
    axes.set(xlabel="approach of the bodies at the contact [µm]", ylabel="contact force [N]")


def _deepest(model: ModalModel, contact: int) -> float:
    """Indentation [m] at the end of a table, or at 1 kN."""
    law = model.contacts[contact].law
    points = getattr(law, "indentation", None)
    if points is not None:
        return float(points[-1])
    assert law is not None
    d = 1e-9
    while float(law.force(d)) < 1e3 and d < 1e-3:
        d *= 1.25
    return d


def _svg(figure: "Figure") -> bytes:
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    FigureCanvasSVG(figure)
    stream = BytesIO()
    figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": "klack"})
    return stream.getvalue()


def documentation_files(model: ModalModel, *, fmi: Literal[2, 3] = 2) -> dict[str, bytes]:
    """Files of the documentation by their path inside the FMU.

    Page, two pictures, licence of the C sources, and the icon where the standard expects it.
    """
    outputs = [v.name for v in fmu_variables(model) if v.causality == "output"]
    place = {2: "model.png", 3: "terminalsAndIcons/icon.png"}[fmi]
    return {
        "documentation/index.html": _page(model).encode(),
        "documentation/diagram.svg": port_picture(model, outputs),
        "documentation/answer.svg": answer_picture(model),
        "documentation/licenses/license.txt": files("klack.exchange.fmu")
        .joinpath("license.txt")
        .read_bytes(),
        place: icon(),
    }


def _page(model: ModalModel) -> str:
    environment = Environment(
        loader=PackageLoader("klack.exchange.fmu", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    variables = fmu_variables(model)
    return environment.get_template("documentation.html").render(
        model=model,
        made=model.provenance,
        pair=model.kind == "pair",
        films=any(contact.film is not None for contact in model.contacts),
        exchange=supports_model_exchange(model),
        inputs=[v for v in variables if v.causality == "input"],
        outputs=[v for v in variables if v.causality == "output"],
        parameters=[v for v in variables if v.causality == "parameter"],
        contacts=[_contact_words(contact) for contact in model.contacts],
        residuals=[
            {"name": item.name.removeprefix("force_"), "value": f"{1e9 * d:.4g} nm/N"}
            for item, d in zip(model.inputs, model.residual_compliance.diagonal(), strict=True)
        ],
        step=f"{1e6 * communication_step(model):g} µs",
        top=f"{1e-3 * _top_frequency(model):.4g} kHz",
        damping=_range(model.damping[model.omega > 0.0]),
    )


def _top_frequency(model: ModalModel) -> float:
    """Frequency [Hz] up to which every body has modes."""
    highest: dict[str, float] = {}
    for name, frequency in zip(model.mode_names, model.frequencies, strict=True):
        body = name.rpartition("_")[0]
        highest[body] = max(highest.get(body, 0.0), float(frequency))
    return min(highest.values(), default=0.0)


def _range(ratios: NDArray[np.float64]) -> str:
    if ratios.size == 0 or ratios.max() == 0.0:
        return "none"
    low, high = 100.0 * ratios.min(), 100.0 * ratios.max()
    return f"{high:.3g} %" if low == high else f"{low:.3g} to {high:.3g} %"


def _contact_words(contact: ModelContact) -> dict[str, str]:
    film = contact.film
    return {
        "name": contact.name,
        "law": _law_words(contact.law),
        "gap": f"{1e6 * contact.gap:.4g} µm",
        "series": f"{1e9 * contact.series_compliance:.4g} nm/N",
        "film": "none"
        if film is None
        else f"squeeze film, pulls with at most {film.suction:.3g} N",
    }


def _law_words(law: InterfaceLaw | None) -> str:
    match law:
        case None:
            return "no contact"
        case LinearLaw():
            return f"linear, {1e-6 * law.stiffness:.4g} N/µm"
        case HertzLaw():
            return f"power {law.exponent:g}"
        case TableLaw():
            last = law.indentation[-1]
            return (
                f"table of {law.indentation.size} points up to {1e6 * last:.3g} µm, then straight"
            )
        case HuntCrossley():
            return f"{_law_words(law.law)}, with dissipation {law.dissipation:.3g}"
        case _:
            return type(law).__name__
