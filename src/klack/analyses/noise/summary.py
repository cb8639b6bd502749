"""The few numbers of a noise study that a script or a terminal wants."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal, cast

import numpy as np
from pydantic import Field
from typing_extensions import TypedDict

from klack.acoustics.third_octave import ENERGY_REFERENCE, ThirdOctaves, nominal_label
from klack.analyses.analysis import Measured
from klack.analyses.json_parts import OwnComponents, Real
from klack.analyses.measures import json_of, number_or_none, text_table, with_measures
from klack.analyses.noise.measures import BODY_MEASURES, DESIGN_MEASURES, STOP_MEASURES
from klack.analyses.noise.record import BodyNoise, NoiseDesign, NoiseStudy
from klack.terminal.tables import TextTable

__all__ = [
    "NoiseJson",
    "noise_measured",
    "noise_to_json",
    "noise_told",
]


class BandJson(TypedDict):
    """Level in a third octave."""

    center_Hz: float
    nominal: str
    level_dB: Annotated[float, Field(description="re (1 uN)^2 s.")]


@with_measures(STOP_MEASURES)
class StopNoiseJson(TypedDict):
    """Force of one stop."""

    third_octave: list[BandJson]


@with_measures(BODY_MEASURES)
class BodyNoiseJson(TypedDict):
    """Vibration and radiation of one body."""

    injected_energy_J: Annotated[dict[str, Real], Field(description="By port.")]
    radiated_energy_J: Annotated[dict[str, Real], Field(description="By group of surfaces.")]


@with_measures(DESIGN_MEASURES)
class DesignNoiseJson(TypedDict):
    """Noise of one design; measures of sound are null where nothing radiates."""

    kind: str
    run: str
    own_components: OwnComponents
    third_octave: Annotated[list[BandJson], Field(description="Of the force of all stops.")]
    stops: Annotated[dict[str, StopNoiseJson], Field(description="By stop.")]
    bodies: Annotated[dict[str, BodyNoiseJson], Field(description="By body.")]


class NoiseJson(DesignNoiseJson):
    """``klack noise``: numbers of the first design, and of all."""

    schema: Literal["klack-noise/1"]
    case: str
    designs: Annotated[dict[str, DesignNoiseJson], Field(description="All of them by name.")]
    warnings: list[str]


def noise_told(study: NoiseStudy) -> Iterator[TextTable | str]:
    """What a terminal shows: the designs side by side, then how far each is from the first.

    Differences are levels; those of loudness and sharpness are factors.  dBA: A-weighted, dBZ:
    unweighted (IEC 61672-1).
    """
    first, *others = study.designs
    table = text_table(study.title, "design", DESIGN_MEASURES, ((d.name, d) for d in study.designs))
    yield replace(table, rows=(*table.rows, *(_difference_row(other, first) for other in others)))


def noise_measured(study: NoiseStudy) -> Iterator[Measured]:
    """Every design, and each of its stops and bodies, with its measures."""
    for design in study.designs:
        yield design.name, design, DESIGN_MEASURES
        for stop in design.stops:
            yield f"{design.name}, {stop.stop}", stop, STOP_MEASURES
        for body in design.bodies:
            yield f"{design.name}, {body.name}", body, BODY_MEASURES


def _difference_row(design: NoiseDesign, first: NoiseDesign) -> tuple[str, ...]:
    return (
        f"{design.name} - {first.name}",
        *(
            measure.apart(design, first) if measure.deviation else ""
            for measure in DESIGN_MEASURES
            if measure.column is not None
        ),
    )


def noise_to_json(study: NoiseStudy) -> NoiseJson:
    """Plain numbers in SI, the unit in the key.

    Returns
    -------
    dict
        The numbers of the first design (``third_octave``: level of the force of all its stops in
        dB re (1 uN)^2 s; ``injected_energy_J``, ``loudness_max_sone`` and so on), and ``designs``:
        the same for every design by name.  Numbers that do not exist are None.
    """
    designs = {design.name: _design(design) for design in study.designs}
    return {
        "schema": "klack-noise/1",
        "case": study.case,
        **designs[study.reference.name],
        "designs": designs,
        "warnings": list(study.warnings),
    }


def _design(design: NoiseDesign) -> DesignNoiseJson:
    found: Any = {
        "kind": design.kind,
        "run": design.run,
        "own_components": dict(design.own_components),
        "third_octave": _bands(design.stops[0].bands, design.band_energy),
        **json_of(DESIGN_MEASURES, design),
        "stops": {
            stop.stop: json_of(STOP_MEASURES, stop)
            | {"third_octave": _bands(stop.bands, stop.bands.energy)}
            for stop in design.stops
        },
        "bodies": {body.name: _body(body) for body in design.bodies},
    }
    return cast(DesignNoiseJson, found)


def _bands(bands: ThirdOctaves, energy: Sequence[float] | np.ndarray) -> list[BandJson]:
    return [
        {
            "center_Hz": float(middle),
            "nominal": nominal_label(int(number)),
            "level_dB": float(10.0 * np.log10(max(float(value), 1e-300) / ENERGY_REFERENCE)),
        }
        for number, middle, value in zip(bands.number, bands.middle, energy, strict=True)
    ]


def _body(body: BodyNoise) -> dict[str, Any]:
    radiated = body.radiated.sum(axis=1)
    return json_of(BODY_MEASURES, body) | {
        "injected_energy_J": dict(zip(body.ports, map(number_or_none, body.injected), strict=True)),
        "radiated_energy_J": dict(zip(body.groups, map(number_or_none, radiated), strict=True)),
    }
