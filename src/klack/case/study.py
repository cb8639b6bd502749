"""A study of a case: which keys vary, which measures are computed, at which points."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, Strict, model_validator

from klack.case.levels import Level, Variant
from klack.case.parameters import as_written
from klack.input.problem import one_of, refuse_key_if
from klack.input.section import Count, InputPath, Number, Section, Text

__all__ = [
    "CaseStudy",
    "NormalRange",
    "StudyDesign",
    "StudyFile",
    "StudyLimit",
    "StudyParameter",
    "StudyRobust",
    "StudySearch",
    "StudySurrogate",
    "Written",
]

Written = Annotated[Text | Number, BeforeValidator(as_written)]


class NormalRange(Section):
    """Gauss's distribution, cut off five standard deviations from its mean."""

    mean: Written = Field(description="Mean with the unit of the key.")
    sd: Written = Field(description="Standard deviation, with its unit.")


class StudyParameter(Section):
    """Values of one parameter: a range, a distribution, a list, or one value."""

    lowest: Written | None = Field(
        default=None, alias="from", description="Lower end of a range, with the unit of the key."
    )
    highest: Written | None = Field(default=None, alias="to", description="Upper end.")
    scale: Literal["linear", "log"] = Field(
        default="linear", description="log: equal steps of the logarithm."
    )
    normal: NormalRange | None = Field(default=None, description="Mean and standard deviation.")
    values: tuple[Written, ...] | None = Field(
        default=None, min_length=1, description="A list of values or words."
    )
    fixed: Written | None = Field(
        default=None, description="One value, for expressions in 'linked'."
    )

    @model_validator(mode="before")
    @classmethod
    def _bare_value(cls, value: Any) -> Any:
        plain = isinstance(value, str | int | float) and not isinstance(value, bool)
        return {"fixed": value} if plain else value

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        given = {
            "from": self.lowest,
            "to": self.highest,
            "normal": self.normal,
            "values": self.values,
            "fixed": self.fixed,
        }
        found = [name for name, value in given.items() if value is not None]
        refuse_key_if(
            found not in (["from", "to"], ["normal"], ["values"], ["fixed"]),
            (),
            got=f"the keys {one_of(found)}" if found else "no values",
            expected="one of: {from: 8 N, to: 20 N}, {normal: {mean: 12 N, sd: 1 N}}, "
            "{values: [8 N, 12 N]}, {fixed: 12 N}",
            hint="a range needs both ends." if len(found) < 2 else f"keep one of {one_of(found)}.",
        )
        refuse_key_if(
            self.scale == "log" and found != ["from", "to"],
            ("scale",),
            got="log without a range",
            expected="{from: 0.1 um, to: 10 um, scale: log}",
            hint="remove it, or give 'from' and 'to'.",
        )
        return self


class StudyDesign(Section):
    """Where the points of a study lie."""

    kind: Literal[
        "sobol", "latin-hypercube", "saltelli", "morris", "grid", "one-at-a-time", "made", "file"
    ] = Field(
        default="sobol",
        description="sobol: even coverage, more points can be added; latin-hypercube: each "
        "parameter evenly; saltelli: for Sobol's indices, 'points' times (2 + number of "
        "parameters) points; morris: elementary effects, 'points' times (1 + number of "
        "parameters); grid: all combinations of 'levels'; one-at-a-time: each parameter by "
        "itself, about the case; made: manufactured valves, the case with the scatter of "
        "'robust'; file: the rows of a CSV file.",
    )
    points: Count = Field(
        default=64,
        le=1_000_000,
        description="Number of points of sobol, latin-hypercube and made; of base points of "
        "saltelli, preferably a power of two; of trajectories of morris, ten or more.",
    )
    levels: Count = Field(
        default=5, le=1000, description="Values of each range in a grid and one-at-a-time."
    )
    seed: Count = Field(default=1, description="Seed of the random numbers.")
    file: InputPath | None = Field(
        default=None,
        description="CSV, relative to this file: a header with the names of all parameters, and "
        "values with units.",
    )

    @model_validator(mode="after")
    def _file(self) -> Self:
        refuse_key_if(
            (self.kind == "file") != (self.file is not None),
            ("kind",),
            got=f"kind: {self.kind}" + (" with a file" if self.file else " without a file"),
            expected="{kind: file, file: points.csv}",
            hint="give both, or neither.",
        )
        return self


class StudyLimit(Section):
    """Bounds of a measure that a design has to keep."""

    most: Written | None = Field(
        default=None,
        description="Largest allowed value, with its unit; or relative to the case: today + 2 %.",
    )
    least: Written | None = Field(default=None, description="Smallest allowed value.")

    @model_validator(mode="after")
    def _some(self) -> Self:
        refuse_key_if(
            self.most is None and self.least is None,
            (),
            got="no bound",
            expected="{most: 400 N}, {least: 95 um}, or both",
            hint="write the bound with its unit.",
        )
        return self


class StudySearch(Section):
    """How long a search for the best points lasts."""

    population: Annotated[int, Strict()] = Field(
        default=40, ge=8, le=10_000, description="Number of points that are computed together."
    )
    generations: Count = Field(
        default=50, le=100_000, description="Number of successive populations."
    )
    refinements: Annotated[int, Strict()] = Field(
        default=200,
        ge=0,
        le=1_000_000,
        description="Number of points about the best ones at the end.",
    )
    polish: Annotated[int, Strict()] = Field(
        default=0,
        ge=0,
        le=1000,
        description="Number of steps with exact derivatives from the recommended point at the "
        "end, if all objectives and bounds are times or impacts of a stroke.",
    )
    seed: Count = Field(default=1, description="Seed of the random numbers.")


class StudyRobust(Section):
    """Scatter of made valves about a design, and what a search makes of it."""

    scatter: Mapping[Text, Written] = Field(
        min_length=1,
        description="Parameter, or path of a key of the case: standard deviation of "
        "manufactured valves about the value of the design, with its unit.",
    )
    valves: Annotated[int, Strict()] = Field(
        default=16,
        ge=4,
        le=10_000,
        description="Number of valves manufactured to every design of klack optimise, with the "
        "same "
        "draws for all designs.",
    )
    value: Text = Field(
        default="mean + 2 sd",
        description="Statistic of a measure over these valves, for objectives and bounds: 'mean "
        "+ 2 sd' or 'quantile 95 %'; towards the worse side.",
    )
    seed: Count = Field(default=1, description="Seed of the random numbers.")


class StudySurrogate(Section):
    """Function fitted to each measure of klack study: shares of the variance, main effects."""

    kind: Literal["polynomial-chaos", "gaussian-process"] = Field(
        description="polynomial-chaos: polynomials of all parameters, up to 10 000 points; "
        "gaussian-process: from the covariance of nearby points, up to 500 points. For the "
        "designs sobol, latin-hypercube, made and file.",
    )


class CaseStudy(Section):
    """Parameters that vary, what follows from them, and what is computed at every point."""

    parameters: Mapping[Text, StudyParameter] = Field(
        min_length=1,
        description="Path of a key of the case, such as network.components.spring.preload, or a "
        "name of your own for 'linked': its values.",
    )
    linked: Mapping[Text, Text] = Field(
        default_factory=dict,
        description="Path of a key of the case: expression of parameters, such as 2 * tip_radius.",
    )
    measures: tuple[Text, ...] = Field(
        min_length=1,
        description="Measures such as closing_time, seat.peak_force, "
        "noise.sound_exposure_level_weighted; of an impact peak_force, restitution.",
    )
    design: StudyDesign = Field(default=StudyDesign(), description="Design of the points.")
    objectives: Mapping[Text, Literal["minimise", "maximise"]] = Field(
        default_factory=dict,
        max_length=4,
        description="Measures that klack optimise minimises or maximises, one to four.",
    )
    constraints: Mapping[Text, StudyLimit] = Field(
        default_factory=dict, description="Measures and the bounds that a design has to meet."
    )
    search: StudySearch = Field(default=StudySearch(), description="Of klack optimise.")
    surrogate: StudySurrogate | None = Field(
        default=None,
        description="For klack study: a surrogate of each measure from the points of one "
        "design, with its leave-one-out error.",
    )
    robust: StudyRobust | None = Field(
        default=None,
        description="Scatter of manufactured valves; with it klack optimise compares designs by "
        "their manufactured valves.",
    )
    variant: Variant | None = Field(
        default=None, description="Variant of the stroke; default: the first one of the case."
    )
    level: Level | None = Field(default=None, description="Level of an impact; default: reduced.")


class StudyFile(Section):
    """A study in a file of its own."""

    klack: Literal[1] = Field(description="Format version of the file: 1.")
    case: Text | None = Field(
        default=None,
        description="Case file of the study, relative to this file: klack app runs the study "
        "with it. On the command line the case is an argument.",
    )
    study: CaseStudy = Field(description="Parameters that vary and measures that are computed.")
