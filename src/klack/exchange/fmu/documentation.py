"""Pages and pictures inside an FMU: what the model is, how to connect it, where it ends."""

from importlib.resources import files
from typing import Literal

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from numpy.typing import NDArray

from klack.contact.laws import HertzLaw, HuntCrossley, LinearLaw, TableLaw
from klack.exchange.fmu.model_description import communication_step
from klack.exchange.fmu.model_exchange import supports_model_exchange
from klack.exchange.fmu.pictures import answer_picture, icon, port_picture
from klack.exchange.fmu.variables import fmu_variables
from klack.exchange.modal_model import ModalModel, ModelContact
from klack.network.protocols import InterfaceLaw

__all__ = ["documentation_files"]


def documentation_files(model: ModalModel, *, fmi: Literal[2, 3] = 2) -> dict[str, bytes]:
    """Files of the documentation by their path inside the FMU.

    The page, its two pictures, the licence of the C sources, and the icon where the version of the
    standard expects it.

    Parameters
    ----------
    model : ModalModel
    fmi : 2 or 3
        Version of the standard.
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
    """Frequency [Hz] up to which every body has modes: the lowest of their highest ones."""
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
