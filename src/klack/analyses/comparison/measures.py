"""Measures of a comparison with a measurement."""

from collections.abc import Callable
from operator import attrgetter
from typing import TypeVar

from klack.analyses.comparison.record import (
    Compared,
    ComparedImpact,
    ComparedVariant,
    HighestShot,
    MeasuredDistribution,
    MeasuredShotsStudy,
)
from klack.analyses.measures import Column, Measure, described_in

__all__ = [
    "COMPARED",
    "DISTRIBUTION_MEASURES",
    "DROPS_MEASURES",
    "HIGHEST_MEASURES",
    "IMPACT_MEASURES",
    "LIFT",
    "LIFT_CURVE",
    "VARIANT_MEASURES",
    "VELOCITY_CURVE",
]

Of = TypeVar("Of")
_THEORY = "theory/measurement"


def _compared(
    key: str,
    symbol: str,
    unit: str,
    column: Column,
    definition: str,
    read: Callable[[Of], Compared],
) -> tuple[Measure[Of], ...]:

    def measure(
        part: str, head: str, words: str, of: Callable[[Compared], float], sign: str = ""
    ) -> Measure[Of]:
        return Measure(
            key=f"{key}_{part}" if part else key,
            name=f"{key.replace('_', ' ')}, {head}",
            symbol=symbol,
            unit=unit,
            definition=f"{definition} {words}",
            read=lambda item: of(read(item)),
            column=Column("", column.factor, sign + column.form, head),
            page=part in ("", "measured"),
        )

    return described_in(
        _THEORY,
        measure("", "computed", "Determined from the computed lift.", attrgetter("computed")),
        measure("measured", "measured", "Median of the strokes.", attrgetter("measured")),
        measure(
            "scatter",
            "scatter",
            "Standard deviation from stroke to stroke; missing for a single one.",
            attrgetter("scatter"),
        ),
        measure(
            "reading_error",
            "reading error",
            "Standard error of determining it from one stroke, median of the strokes.",
            attrgetter("error"),
        ),
        Measure(
            key=f"{key}_strokes",
            name=f"{key.replace('_', ' ')}, strokes",
            symbol="n",
            definition="Strokes that have this number.",
            read=lambda item: read(item).count,
            kind="whole",
            column=Column("", 1.0, "d", "strokes"),
        ),
        measure("difference", "difference", "Computed minus measured.", _difference, "+"),
        Measure(
            key=f"{key}_difference_in_scatter",
            name=f"{key.replace('_', ' ')}, difference in standard deviations",
            definition="Difference over the scatter, or over the reading error where that is larger"
            " or there is no scatter.",
            read=lambda item: read(item).in_scatter,
            form="signed",
            digits=1,
            column=Column("", 1.0, "+.1f", "in std. dev."),
        ),
    )


_difference = attrgetter("difference")
_LIFT = Column("um", 1e6, ".2f", "lift")

COMPARED: tuple[tuple[str, tuple[Measure[ComparedImpact], ...]], ...] = (
    (
        "time [us]",
        _compared(
            "time", "t", "s", Column("us", 1e6, ".1f"), "First touch, from the trigger.",
            attrgetter("time"),
        ),
    ),
    (
        "approach speed [m/s]",
        _compared(
            "approach_speed", "v_0", "m/s", Column("m/s", 1.0, ".3f"),
            "Speed at the stop level, from the preceding flight.", attrgetter("approach_speed"),
        ),
    ),
    (
        "restitution",
        _compared(
            "restitution", "e", "1", Column("", 1.0, ".3f"),
            "Speed after the impact over speed before it, from both flights.",
            attrgetter("restitution"),
        ),
    ),
    (
        "rebound height [um]",
        _compared(
            "rebound_height", "h", "m", Column("um", 1e6, ".2f"),
            "Largest distance from the level of the stop in the flight after the impact.",
            attrgetter("rebound_height"),
        ),
    ),
)  # fmt: skip
"""Row titles and measures, column by column, of every impact."""

IMPACT_MEASURES = tuple(measure for _, measures in COMPARED for measure in measures)
"""Of an impact that the model and at least half of the strokes have."""


def _curve(
    key: str, symbol: str, unit: str, column: Column, rms: str, scatter: str
) -> tuple[Measure[ComparedVariant], ...]:
    of_all, of_one = attrgetter(rms), attrgetter(scatter)
    return described_in(
        _THEORY,
        Measure(
            key=f"{key}_rms",
            name=f"{key}, root mean square difference",
            symbol=f"d{symbol}",
            unit=unit,
            definition=f"Root mean square of computed minus median measured {key}, over the whole "
            "record.",
            read=of_all,
            column=Column("", column.factor, column.form, "difference, rms"),
        ),
        Measure(
            key=f"{key}_rms_scatter",
            name=f"{key}, root mean square scatter",
            symbol=f"s_{symbol}",
            unit=unit,
            definition="Root mean square of the single strokes about the median, noise included; "
            "missing for one stroke.",
            read=of_one,
            column=Column("", column.factor, column.form, "scatter, rms"),
        ),
        Measure(
            key=f"{key}_rms_in_scatter",
            name=f"{key}, difference in standard deviations",
            symbol=f"d{symbol}/s_{symbol}",
            definition="Root mean square difference over root mean square scatter.",
            read=lambda variant: of_all(variant) / of_one(variant),
            form="fixed",
            digits=1,
            column=Column("", 1.0, ".1f", "in std. dev."),
        ),
    )


LIFT_CURVE = _curve("lift", "y", "m", _LIFT, "lift_rms", "lift_scatter")
VELOCITY_CURVE = _curve(
    "velocity", "v", "m/s", Column("m/s", 1.0, ".4f"), "velocity_rms", "velocity_scatter"
)
LIFT = _compared(
    "lift",
    "s",
    "m",
    _LIFT,
    "Rest level on the opening stop minus rest level on the seat: the gap plus the elastic "
    "compression of the stops.",
    attrgetter("way"),
)

VARIANT_MEASURES: tuple[Measure[ComparedVariant], ...] = described_in(
    _THEORY,
    Measure(
        key="strokes",
        symbol="n",
        definition="Measured strokes that are used.",
        read=attrgetter("count"),
        kind="whole",
        page=True,
    ),
    *LIFT_CURVE,
    *VELOCITY_CURVE,
    Measure(
        key="velocity_bandwidth",
        name="bandwidth of the velocity",
        symbol="f_v",
        unit="Hz",
        definition="3 dB bandwidth of the differentiator from lift to velocity, for computed and "
        "measured lift.",
        digits=3,
    ),
    *LIFT,
)
"""Of one variant beside its measurement."""

HIGHEST_MEASURES: tuple[Measure[HighestShot], ...] = described_in(
    _THEORY,
    Measure(
        key="rebound_height",
        name="height",
        symbol="h_max",
        unit="m",
        definition="Rebound height of the measured stroke that rebounds highest from a stop.",
        column=Column("um", 1e6, ".2f"),
        remark=lambda shot: f" ± {1e6 * shot.rebound_height_error:.2f}",
        page=True,
    ),
    Measure(
        key="rebound_height_error",
        name="standard error of the height",
        unit="m",
        definition="Standard error of that height.",
        digits=2,
    ),
    Measure(
        key="restitution",
        symbol="e",
        definition="Restitution of the same stroke.",
        form="fixed",
        digits=3,
        column=Column("", 1.0, ".3f"),
        remark=lambda shot: f" ± {shot.restitution_error:.3f}",
        page=True,
    ),
    Measure(
        key="restitution_error",
        name="standard error of the restitution",
        definition="Standard error of that restitution.",
        form="fixed",
        digits=3,
    ),
    Measure(
        key="strokes",
        name="of strokes",
        symbol="n",
        definition="Number of strokes of which it is the highest.",
        read=attrgetter("count"),
        kind="whole",
        column=Column("", 1.0, "d"),
        page=True,
    ),
    Measure(
        key="too_high_by_reading",
        unit="m",
        definition="Amount by which reading errors alone raise the highest of that many readings.",
        read=attrgetter("by_reading"),
        digits=3,
        column=Column("um", 1e6, ".2f"),
    ),
    Measure(
        key="above_median",
        name="above the median",
        unit="m",
        definition="Amount by which the highest of that many strokes lies above the median, "
        "without reading errors.",
        digits=3,
        column=Column("um", 1e6, ".2f"),
    ),
    Measure(
        key="bounces",
        symbol="n_b",
        definition="Bounces from this stop, median of the strokes.",
        digits=3,
        column=Column("", 1.0, "g"),
    ),
)
"""Of the stroke that rebounds highest, the usual stand-in for a centred impact."""

DROPS_MEASURES: tuple[Measure[MeasuredShotsStudy], ...] = described_in(
    _THEORY,
    Measure(
        key="drops",
        symbol="n",
        definition="Measured drops that are used.",
        read=lambda study: len(study.names),
        kind="whole",
        page=True,
    ),
    *_compared(
        "approach_speed",
        "v_0",
        "m/s",
        Column("m/s", 1.0, ".3f"),
        "Speed before the first impact.",
        attrgetter("approach_speed"),
    ),
)
"""Of measured drops beside computed shots."""


def _in_its_unit(
    key: str, name: str, symbol: str, definition: str, field: str = ""
) -> Measure[MeasuredDistribution]:
    return Measure(
        key=key,
        name=name,
        symbol=symbol,
        unit="",
        definition=definition,
        read=attrgetter(field or key),
        digits=3,
        unit_of=attrgetter("unit"),
    )


DISTRIBUTION_MEASURES: tuple[Measure[MeasuredDistribution], ...] = described_in(
    _THEORY,
    _in_its_unit(
        "reading_error",
        "reading error",
        "",
        "Standard error of determining it from one drop, median of the drops.",
        "error",
    ),
    _in_its_unit("centred", "centred shot", "x_0", "Value of the centred computed shot."),
    _in_its_unit(
        "expected_highest",
        "mean highest",
        "",
        "Mean of the highest of as many computed shots as drops were measured.",
    ),
    _in_its_unit("highest_bias", "bias of the highest", "", "Mean highest minus the centred shot."),
    Measure(
        key="statistic",
        name="distance of the distributions",
        symbol="D",
        definition="Largest distance of the two cumulative distributions (Kolmogorov and Smirnov).",
        form="share",
        digits=0,
        page=True,
    ),
    Measure(
        key="significance",
        symbol="p",
        definition="Probability of a larger distance if both distributions were the same.",
        form="fixed",
        digits=3,
        page=True,
    ),
)
"""Of one number of many drops."""
