"""Output of ``--json`` of each command: one type for the code, the schema and the docs.

The functions that make the JSON are annotated with these types, so that the type checker compares
each of their keys; the schema that ``klack schema --kind result`` prints and the page of the
reference are generated from them.  Numbers are SI, the unit in the key; what does not exist (nan,
infinite) is null.  The number behind the slash of ``schema`` goes up when a key goes or changes its
meaning; new keys leave it as it is.
"""

from typing import TYPE_CHECKING, Annotated, Any, Literal, NotRequired, TypeAlias

from pydantic import Field, TypeAdapter
from typing_extensions import TypedDict

from klack.analyses.impact.measures import DEVIATION_MEASURES, LEVEL_MEASURES
from klack.analyses.measures import Measure, described, json_type
from klack.analyses.shots.measures import SHOT_MEASURES
from klack.analyses.stroke.measures import EVENT_MEASURES, VARIANT_MEASURES

__all__ = [
    "MEASURES",
    "AdviceJson",
    "CacheJson",
    "CalculixJson",
    "CalibrationJson",
    "DropsJson",
    "ExportJson",
    "ImpactJson",
    "InspectionJson",
    "NoiseJson",
    "ReductionJson",
    "ReportJson",
    "ShotsJson",
    "StrokeJson",
    "StrokesJson",
    "VerificationJson",
    "measures_catalogue",
    "result_schema",
]

Real = float | None
OwnComponents = Annotated[
    dict[str, str], Field(description="First digits of the SHA-256 of their code, by name.")
]
Share = Annotated[Real, Field(description="Relative: 0.01 is 1 %.")]


if TYPE_CHECKING:  # made from the catalogues of measures
    DeviationJson: TypeAlias = dict[str, Any]
    LevelJson: TypeAlias = dict[str, Any]
    ShotJson: TypeAlias = dict[str, Any]
    EventJson: TypeAlias = dict[str, Any]

    class VariantNumbersJson(TypedDict):
        """Of one variant."""

else:
    DeviationJson = json_type(
        "DeviationJson", "Deviation of one result from another.", DEVIATION_MEASURES
    )
    LevelJson = json_type(
        "LevelJson",
        "Impact at one level.",
        LEVEL_MEASURES,
        {"doubts": Annotated[list[str], Field(description="Why the level may be wrong.")]},
    )
    ShotJson = json_type("ShotJson", "One shot.", SHOT_MEASURES)
    EventJson = json_type(
        "EventJson",
        "One impact of a stroke.",
        EVENT_MEASURES,
        {"stop": Annotated[str, Field(description="Name of the end stop.")]},
    )
    VariantNumbersJson = json_type(
        "VariantNumbersJson", "One variant of a stroke.", VARIANT_MEASURES
    )


class ContactJson(TypedDict):
    """Mesh of a contact at the force of the impact; null without a mesh."""

    surfaces: Annotated[str, Field(description="Empty for a stop without surfaces.")]
    half_width_m: Real
    size_over_half_width: Annotated[Real, Field(description="Good up to 1, doubtful above 1.5.")]
    points_across: Annotated[int | None, Field(description="Too few below 5.")]
    doubts: Annotated[
        list[str],
        Field(description="Reasons why no error of impacts there can be estimated; empty if none."),
    ]


class ImpactJson(TypedDict):
    """``klack impact`` and ``klack demo``."""

    schema: Literal["klack-impact/1"]
    case: str
    complete: Annotated[bool, Field(description="False: a level failed.")]
    failures: Annotated[
        dict[str, str], Field(description="Why a level has no numbers, by its name.")
    ]
    answer: Annotated[str, Field(description="Name of the best level.")]
    levels: Annotated[dict[str, LevelJson], Field(description="By the name of the level.")]
    deviation: Annotated[
        DeviationJson | None, Field(description="Of the level reduced from the reference.")
    ]
    deviations: Annotated[
        dict[str, DeviationJson], Field(description="Of every level that is not the reference.")
    ]
    estimated_error: Annotated[
        dict[str, DeviationJson | None],
        Field(description="Of every reduced level, by a run at the interface level."),
    ]
    contact: Annotated[ContactJson, Field(description="All levels but lumped share it.")]
    warnings: list[str]


class ReducedBodyJson(TypedDict):
    """A body after reduction."""

    mass_kg: Real
    degrees_of_freedom: int
    rigid_modes: int
    frequencies_Hz: Annotated[list[float], Field(description="Of the elastic modes.")]
    static_compliance_m_per_N: float
    modal_compliance_m_per_N: float
    correction: str


class TransferJson(TypedDict):
    """Transfer functions of a body."""

    valid_up_to_Hz: Annotated[dict[str, float], Field(description="By the kind of reduction.")]
    tolerance_dB: float
    loss_factor: float


class ReductionJson(TypedDict):
    """``klack reduce``."""

    schema: Literal["klack-reduce/1"]
    case: str
    bodies: Annotated[dict[str, ReducedBodyJson], Field(description="By name.")]
    transfer: Annotated[dict[str, TransferJson], Field(description="By body.")]


class PassageJson(TypedDict):
    """One passage between two stops; null for what the run does not reach."""

    at_10_percent_s: Annotated[Real, Field(description="Of the lift.")]
    at_50_percent_s: Real
    at_90_percent_s: Real
    stop: Annotated[str | None, Field(description="Name of the end stop.")]
    touch_s: Annotated[Real, Field(description="First touch of that stop.")]


class TimesJson(TypedDict):
    """Opening and closing of one body."""

    starts: Annotated[str, Field(description="closed or open: opening or closing comes first.")]
    lift_m: Real
    lift_between_stops: Annotated[bool, Field(description="False: largest minus smallest lift.")]
    opening: PassageJson
    closing: PassageJson


class StartJson(TypedDict):
    """Static equilibrium at time zero."""

    displacement_m: Annotated[dict[str, float], Field(description="By port.")]
    pressure_Pa: Annotated[dict[str, float], Field(description="Absolute, by node.")]
    pressure_stated: Annotated[
        dict[str, bool], Field(description="Whether the case states it; else it is found.")
    ]
    mass_flow_kg_s: Annotated[dict[str, float], Field(description="By restriction.")]
    residual_force_N: Annotated[dict[str, float], Field(description="What is left, by body.")]
    notes: Annotated[list[str], Field(description="Quantities without a steady state.")]


class VariantJson(TimesJson, VariantNumbersJson):
    """One variant of a stroke; opening and closing are those of the needle."""

    label: str
    start: Annotated[StartJson | None, Field(description="Null for a continued or free start.")]
    failure: Annotated[str | None, Field(description="Why the run ended early.")]
    fine_record_ends_s: Annotated[
        dict[str, Real],
        Field(description="Stops whose force in fine steps ends there."),
    ]
    events: Annotated[list[EventJson], Field(description="Impacts in the order of time.")]
    bodies: Annotated[
        dict[str, TimesJson], Field(description="Of every other body between stops, by name.")
    ]


class StrokeJson(VariantJson):
    """``klack stroke``: numbers of the reference variant, and of all."""

    schema: Literal["klack-stroke/1"]
    case: str
    klack: Annotated[str, Field(description="Version.")]
    own_components: OwnComponents
    variant: Annotated[str, Field(description="Name of the reference variant.")]
    variants: Annotated[dict[str, VariantJson], Field(description="All of them by name.")]
    stops: Annotated[
        dict[str, ContactJson],
        Field(description="By the name of the end stop; all variants but lumped ones share them."),
    ]


class HighestRuleJson(TypedDict):
    """Highest rebound against the centred shot."""

    holds: bool
    restitution_bias: Real
    rebound_height_bias: Real
    relative_restitution_bias: Real
    relative_rebound_height_bias: Real
    shots_at_least_as_high_as_centric: int
    sentence: str


class ShotsJson(TypedDict):
    """``klack shots``."""

    schema: Literal["klack-shots/1"]
    case: str
    klack: Annotated[str, Field(description="Version.")]
    seed: int
    centric: Annotated[ShotJson, Field(description="The centred shot.")]
    shots: list[ShotJson]
    highest: Annotated[int, Field(description="Index of the highest rebound.")]
    distribution: Annotated[
        dict[str, dict[str, Real]],
        Field(description="By measure: mean, standard_deviation, quantile_0 to quantile_1."),
    ]
    rule: HighestRuleJson
    wall_time_s: Real
    shot_time_s: Real
    workers: int
    resumed: Annotated[int, Field(description="Shots resumed from an interrupted run.")]


class BandJson(TypedDict):
    """Level in a third octave."""

    center_Hz: float
    nominal: str
    level_dB: Annotated[float, Field(description="re (1 uN)^2 s.")]


class StopNoiseJson(TypedDict):
    """Force of one stop."""

    impacts: int
    peak_force_N: Real
    impulse_Ns: Real
    third_octave: list[BandJson]


class BodyNoiseJson(TypedDict):
    """Vibration and radiation of one body."""

    highest_mode_Hz: Real
    injected_energy_J: Annotated[dict[str, Real], Field(description="By port.")]
    vibration_energy_J: Real
    vibration_energy_by_mobility_J: Real
    radiated_energy_J: Annotated[dict[str, Real], Field(description="By group of surfaces.")]


class ClickJson(TypedDict):
    """Sound of one click; null where nothing radiates."""

    loudness_max_sone: Real
    loudness_level_phon: Real
    sharpness_acum: Real
    kurtosis: Real
    crest_factor: Real
    sound_exposure_level_dB: Real
    sound_exposure_level_dBA: Real
    peak_level_dB: Real
    pattern_level_dBA: Real


class DesignNoiseJson(ClickJson):
    """Noise of one design."""

    kind: str
    run: str
    own_components: OwnComponents
    third_octave: Annotated[list[BandJson], Field(description="Of the force of all stops.")]
    injected_energy_J: Annotated[Real, Field(description="Into the bodies, rigidly held.")]
    support_energy_J: Annotated[Real, Field(description="Into mount and plate.")]
    radiated_energy_J: Real
    radiated_energy_upper_bound_J: Real
    valid_from_Hz: Real
    balanced_below_Hz: Real
    valid_up_to_Hz: Real
    stops: Annotated[dict[str, StopNoiseJson], Field(description="By stop.")]
    bodies: Annotated[dict[str, BodyNoiseJson], Field(description="By body.")]


class NoiseJson(DesignNoiseJson):
    """``klack noise``: numbers of the first design, and of all."""

    schema: Literal["klack-noise/1"]
    case: str
    designs: Annotated[dict[str, DesignNoiseJson], Field(description="All of them by name.")]


class CalibratedJson(TypedDict):
    """One calibrated parameter, in ``unit``."""

    value: float
    standard_error: Real
    unit: str
    lower_95: Real
    upper_95: Real
    start: float
    scatter: Real
    profile_lower_95: NotRequired[Real]
    profile_upper_95: NotRequired[Real]


class CalibrationJson(TypedDict):
    """``klack calibrate``."""

    schema: Literal["klack-calibrate/1"]
    case: str
    klack: Annotated[str, Field(description="Version.")]
    own_components: OwnComponents
    variant: str
    strokes: int
    parameters: Annotated[dict[str, CalibratedJson], Field(description="By their path.")]
    residual_rms_um: Annotated[float, Field(description="Of the lift.")]
    residual_rms_before_um: float
    misfit: Real
    evaluations: int
    resumed: int
    wall_time_s: float
    profile_time_s: float
    correlation: Annotated[
        list[list[Real]], Field(description="Of the estimates, in the order of the parameters.")
    ]
    converged: bool
    warnings: list[str]


class RejectedJson(TypedDict):
    """A recording that was left out."""

    name: str
    reason: str


class HighestStrokeJson(TypedDict):
    """The measured stroke that rebounds highest from a stop."""

    stop: str
    stroke: str
    strokes: int
    rebound_height_m: Real
    rebound_height_error_m: Real
    restitution: Real
    restitution_error: Real
    too_high_by_reading_m: Real
    above_median_m: Real
    bounces: Real


class ComparedVariantJson(TypedDict):
    """A variant compared with its recording."""

    agreement: Literal["excellent", "fair", "none", "unknown"]
    verdict: str
    strokes: int
    rejected: list[RejectedJson]
    lift_rms_m: Real
    lift_rms_scatter_m: Real
    velocity_rms_m_s: Real
    velocity_rms_scatter_m_s: Real
    velocity_bandwidth_Hz: Real
    lift_m: Real
    lift_measured_m: Real
    lift_scatter_m: Real
    lift_reading_error_m: Real
    lift_difference_m: Real
    lift_difference_in_scatter: Real
    impacts: Annotated[
        list[dict[str, str | int | Real]],
        Field(
            description="stop, number, and of time, approach_speed, restitution and rebound_height "
            "what was computed, measured, its scatter, reading error and difference."
        ),
    ]
    highest_rebound: list[HighestStrokeJson]


class StrokesJson(ComparedVariantJson):
    """``klack compare`` of strokes: numbers of the first variant, and of all."""

    schema: Literal["klack-compare-strokes/1"]
    case: str
    klack: Annotated[str, Field(description="Version.")]
    variant: str
    variants: Annotated[dict[str, ComparedVariantJson], Field(description="All of them by name.")]
    rule: Annotated[str, Field(description="How the verdict is found.")]


class DropsJson(TypedDict):
    """``klack compare`` of shots."""

    schema: Literal["klack-compare-shots/1"]
    case: str
    klack: Annotated[str, Field(description="Version.")]
    drops: int
    rejected: list[RejectedJson]
    approach_speed_m_s: Real
    approach_speed_measured_m_s: Real
    approach_speed_scatter_m_s: Real
    distribution: Annotated[
        dict[str, dict[str, Any]],
        Field(description="By measure: computed and measured quantiles, centred, highest, test."),
    ]
    verdict: str
    bias: str
    rule: Annotated[str, Field(description="How the verdict is found.")]


class ProgramJson(TypedDict):
    """Impact as one program computed it."""

    peak_force_N: Real
    contact_time_s: Real
    impulse_Ns: Real
    restitution: Real
    energy_balance: Real
    steps: int
    step_s: float
    wall_time_s: Real


class OtherProgramJson(ProgramJson):
    """Impact as the other program computed it."""

    iterations: int | None
    energy_swing: Real


class CalculixJson(TypedDict):
    """``klack compare --calculix``."""

    schema: Literal["klack-compare-calculix/1"]
    case: str
    level: str
    program: str
    klack: ProgramJson
    other: OtherProgramJson
    deviation: DeviationJson
    wall_time_ratio: Real


class AdvisedSettingJson(TypedDict):
    """One setting with its measured convergence."""

    name: str
    kind: str
    values: Annotated[dict[str, dict[str, Real]], Field(description="By key: now, advised.")]
    order: float
    order_measured: bool
    factors_run: list[float]
    factor: float
    reached: bool
    error: dict[str, dict[str, Real]]
    runs: str


class FixedErrorJson(TypedDict):
    """An error that no setting changes."""

    name: str
    error: dict[str, Real]


class AdviceJson(TypedDict):
    """``klack advise``: errors relative, or in dB where the name says so."""

    schema: Literal["klack-advise/1"]
    case: str
    level: str
    judged_up_to_Hz: Real
    target: dict[str, float]
    meets_target: dict[Literal["now", "advised"], bool | None]
    meshes_given: list[str]
    settings: list[AdvisedSettingJson]
    fixed: list[FixedErrorJson]
    expected_error: dict[Literal["now", "advised"], dict[str, Real]]
    run_again: dict[Literal["now", "advised"], dict[str, Real]] | None
    degrees_of_freedom: dict[Literal["now", "advised"], int] | None
    changes: Annotated[dict[str, str], Field(description="By key: what the advice writes.")]
    notes: list[str]
    runs: int
    wall_time_s: float


class CheckJson(TypedDict):
    """One verification check."""

    group: str
    name: str
    expected: Real
    computed: Real
    deviation: Real
    deviation_unit: str
    tolerance: float
    headroom: Real
    wide: bool
    passed: bool
    source: str
    reason: str


class VerificationJson(TypedDict):
    """``klack verify``."""

    schema: Literal["klack-verify/1"]
    about: Annotated[dict[str, str], Field(description="Versions and machine.")]
    checks: list[CheckJson]


class CacheJson(TypedDict):
    """``klack cache``."""

    schema: Literal["klack-cache/1"]
    folder: Annotated[str | None, Field(description="Null where the cache is off.")]
    count: int
    size_B: int
    limit_B: int


class InspectedRowJson(TypedDict):
    """One row of the table."""

    what: str
    name: str
    content: str


class InspectionJson(TypedDict):
    """``klack inspect``."""

    schema: Literal["klack-inspect/1"]
    file: str
    parts: Annotated[
        dict[str, list[InspectedRowJson]],
        Field(description="By the name of the file, or of each body of a case."),
    ]


class ReportJson(TypedDict):
    """``klack report``."""

    schema: Literal["klack-report/1"]
    case: str
    result: Annotated[str, Field(description="Folder of the result.")]
    folder: Annotated[str, Field(description="Where the report is.")]
    files: list[str]


class ExportJson(TypedDict):
    """``klack export``."""

    schema: Literal["klack-export/1"]
    case: str
    to: Annotated[str, Field(description="Format.")]
    folder: Annotated[str, Field(description="Where the files are.")]
    files: Annotated[list[str], Field(description="Names of the files and folders written.")]


_RESULTS = (
    ImpactJson,
    StrokeJson,
    ShotsJson,
    NoiseJson,
    ReductionJson,
    AdviceJson,
    InspectionJson,
    ReportJson,
    ExportJson,
    StrokesJson,
    DropsJson,
    CalculixJson,
    CalibrationJson,
    VerificationJson,
    CacheJson,
)


MEASURES: dict[str, tuple[Measure[Any], ...]] = {
    "impact level": LEVEL_MEASURES,
    "difference of two levels": DEVIATION_MEASURES,
    "stroke variant": VARIANT_MEASURES,
    "impact of a stroke": EVENT_MEASURES,
    "shot": SHOT_MEASURES,
}
"""The catalogue of measures, by what they are of."""


def measures_catalogue() -> dict[str, Any]:
    """Description of every measure: key, name, symbol, unit, definition and source, versioned."""
    return {
        "schema": "klack-measures/1",
        **{of: described(measures) for of, measures in MEASURES.items()},
    }


def result_schema() -> dict[str, Any]:
    """JSON schema (draft 2020-12) of what every command writes with ``--json``.

    The key ``schema`` of a result tells which of the choices it is.  ``x-measures`` is the
    catalogue of measures.
    """
    inputs: list[tuple[int, Any, TypeAdapter[Any]]] = [
        (index, "serialization", TypeAdapter(kind)) for index, kind in enumerate(_RESULTS)
    ]
    references, definitions = TypeAdapter.json_schemas(inputs)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Results of klack",
        "oneOf": [references[index, "serialization"] for index in range(len(_RESULTS))],
        "$defs": definitions["$defs"],
        "x-measures": measures_catalogue(),
    }
