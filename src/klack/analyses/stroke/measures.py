"""Measures of impacts and variants of a stroke."""

from operator import attrgetter
from typing import Literal

from klack.analyses.measures import Column, Measure, described_in
from klack.analyses.stroke.delivery import Delivery
from klack.analyses.stroke.record import StrokeVariant
from klack.report.wording import count
from klack.simulation.network_result import ImpactEvent
from klack.units import format_si

__all__ = [
    "DELIVERY_MEASURES",
    "EVENT_MEASURES",
    "NOT_REACHED",
    "SPEEDS",
    "VARIANT_MEASURES",
    "pace",
    "real_time_factor",
    "shown_measures",
    "step_parts",
    "steps_told",
]

NOT_REACHED = "not reached"


def real_time_factor(variant: StrokeVariant) -> float:
    """Wall time of the time loop over the simulated time [-]."""
    time = variant.result.time
    simulated = float(time[-1] - time[0]) if time.size else 0.0
    return variant.result.wall_time / simulated if simulated > 0.0 else float("nan")


def pace(variant: StrokeVariant) -> str:
    """How fast the computation was, beside the valve itself.

    >>> import numpy as np
    >>> from types import SimpleNamespace as Of
    >>> runs = (Of(result=Of(time=np.array([0.0, 5e-3]), wall_time=t)) for t in (0.59, 1e-3))
    >>> [pace(run) for run in runs]
    ['118 times slower than real time', '5 times faster than real time']
    """
    factor = real_time_factor(variant)
    if not factor > 0.0:
        return "no time passed"
    times, word = (factor, "slower") if factor >= 1.0 else (1.0 / factor, "faster")
    return f"{times:.3g} times {word} than real time"


def step_parts(variant: StrokeVariant) -> tuple[tuple[str, str], ...]:
    """Number and size of the steps of each kind, and how often all were halved."""
    done, sizes = variant.result.steps, variant.result.sizes
    flight, near = (format_si(sizes.step * steps, "s", 3) for steps in (sizes.coarse, sizes.near))
    fine = ("in contact", f"{count(done.fine)} of {format_si(sizes.step, 's', 3)}")
    if sizes.coarse > 1:
        parts = [
            ("in flight", f"{count(done.flight)} of {flight}"),
            ("about touches", f"{count(done.near)} of {near}, in {count(done.sub)} parts"),
            fine,
        ]
    else:
        parts = [("all", fine[1])]
    if variant.halvings:
        times = {1: "once", 2: "twice"}.get(variant.halvings, f"{variant.halvings} times")
        parts.append(("halved because impacts depended on them", times))
    return tuple(parts)


def steps_told(variant: StrokeVariant) -> str:
    """The same in one line."""
    return "; ".join(f"{where}: {what}" for where, what in step_parts(variant))


def _besides(event: ImpactEvent) -> str:
    """Why an impact has no restitution: what acts as well."""
    return f"with {event.besides}" if event.besides else ""


TOUCH_SPEED: Measure[ImpactEvent] = Measure(
    key="touch_speed",
    title="speed at touch",
    symbol="v_t",
    unit="m/s",
    definition="Closing speed of the centres of mass when the faces meet, after braking by the "
    "film: wear and yield depend on it.",
    form="fixed",
    column=Column("m/s", 1.0, ".4f", "at touch"),
    page=True,
)

EVENT_MEASURES: tuple[Measure[ImpactEvent], ...] = described_in(
    "theory/stroke",
    Measure(
        key="time",
        symbol="t",
        unit="s",
        definition="First touch, from the start of the run.",
        digits=5,
        column=Column("ms", 1000.0, ".4f"),
        page=True,
    ),
    Measure(
        key="approach_speed",
        title="speed",
        symbol="v_0",
        unit="m/s",
        definition="Closing speed of the centres of mass at first touch, or the highest "
        "one since the film force set in.",
        form="fixed",
        column=Column("m/s", 1.0, ".4f", "speed"),
        page=True,
    ),
    TOUCH_SPEED,
    Measure(
        key="peak_force",
        symbol="F_max",
        unit="N",
        definition="Largest force of contact and film together.",
        column=Column("N", 1.0, ".4g"),
        page=True,
    ),
    Measure(
        key="peak_time",
        symbol="t_max",
        unit="s",
        definition="Time of the peak force, from the start of the run.",
        digits=5,
    ),
    Measure(
        key="contact_time",
        symbol="t_c",
        unit="s",
        definition="Time closed, all contacts of the impact together; of a contact that stays "
        "closed, up to rest: three of the longest periods of its bodies, or four bounces.",
        column=Column("us", 1000000.0, ".2f"),
        page=True,
    ),
    Measure(
        key="separation_time",
        symbol="t_1",
        unit="s",
        definition="End of the last contact, from the start of the run; missing if it stays "
        "closed.",
        digits=5,
    ),
    Measure(
        key="impulse",
        symbol="J",
        unit="N s",
        definition="Integral of the force of contact and film together.",
        column=Column("mN s", 1000.0, ".4g"),
        page=True,
    ),
    Measure(
        key="restitution",
        symbol="e",
        definition="Opening speed over approach speed of the centres of mass; missing without "
        "separation, where another stop meanwhile changes that speed by more than 1 % of the "
        "change by this impact, and where rotation exchanges more than a tenth of the energy of "
        "approach.",
        note="It results from waves, fluid and films, and is never an input of the flexible "
        "variants; a body still vibrating from an earlier impact may rebound faster than it "
        "arrived.",
        form="fixed",
        digits=3,
        column=Column("", 1.0, ".4f"),
        page=True,
        why=_besides,
    ),
    Measure(
        key="energy_loss",
        symbol="W",
        unit="J",
        definition="Kinetic energy of the centre of mass before the impact minus the energy "
        "after it, of the relative motion where both bodies move; missing like the restitution.",
        digits=3,
        column=Column("uJ", 1000000.0, ".4g"),
        page=True,
        why=_besides,
    ),
)
"""Of one impact; contacts closer than the longest period of the needle are one."""

SPEEDS = "speed: highest since the film began to press; at touch: when the faces meet"
"""Head of a table of impacts with films."""


def shown_measures(*, filmed: bool) -> tuple[Measure[ImpactEvent], ...]:
    """Measures of impacts for a table; without a film both speeds are the same."""
    return tuple(measure for measure in EVENT_MEASURES if filmed or measure.key != TOUCH_SPEED.key)


def _at_shares(way: Literal["opening", "closing"]) -> tuple[Measure[StrokeVariant], ...]:
    return tuple(
        Measure(
            key=f"{way}_time_at_{share}_percent",
            symbol=f"t_{way[0]},{share}",
            unit="s",
            definition=f"Time from the start of the run until the body has passed {share} % of "
            f"its own travel while {way}.",
            read=attrgetter(f"needle_times.{way}.at_{share}"),
            absent=NOT_REACHED,
        )
        for share in (10, 50, 90)
    )


VARIANT_MEASURES: tuple[Measure[StrokeVariant], ...] = described_in(
    "theory/stroke",
    Measure(
        key="opening_time",
        symbol="t_o",
        unit="s",
        definition="From time zero (that of the first run, if this one continues it) to the "
        "first touch of the opening stop in the first whole stroke, otherwise in the longest: "
        "the stop that ends the lift, possibly that of a body that carries the needle. No value "
        "if it is not touched; never negative.",
        read=lambda variant: variant.needle_times.opening.touch,
        column=Column("ms", 1000.0, ".4f", "opens"),
        page=True,
        absent=NOT_REACHED,
    ),
    *_at_shares("opening"),
    Measure(
        key="closing_time",
        symbol="t_c",
        unit="s",
        definition="From time zero, as the opening time, to the first touch of the seat after "
        "the largest lift of that stroke; of a valve that starts open, of its first closing. No "
        "value if the needle stays closed or the run ends earlier; never negative.",
        read=lambda variant: variant.needle_times.closing.touch,
        column=Column("ms", 1000.0, ".4f", "closes"),
        page=True,
        absent=NOT_REACHED,
    ),
    *_at_shares("closing"),
    Measure(
        key="complete",
        definition="Whether the run reached its end.",
        read=lambda variant: not variant.result.failure,
        kind="truth",
    ),
    Measure(
        key="impacts",
        symbol="n",
        definition="Impacts on all stops.",
        read=lambda variant: len(variant.result.events),
        column=Column("", 1.0, "d"),
        page=True,
        kind="whole",
    ),
    Measure(
        key="delivered_mass",
        symbol="m",
        unit="kg",
        definition="Mass that leaves the valve through all restrictions with net outflow to "
        "ambient or to a prescribed pressure, including those from one prescribed pressure to "
        "another; missing without such a restriction.",
        page=True,
    ),
    Measure(
        key="end_time",
        symbol="t_e",
        unit="s",
        definition="Time reached by the run.",
        read=lambda variant: float(variant.result.time[-1]),
    ),
    Measure(
        key="energy_residual",
        symbol="r_E",
        definition="Supplies minus losses minus the increase of all stores, over the "
        "throughput, or the energy of the bodies and 0.1 % of all stores if larger: round-off "
        "in a correct run.",
        read=lambda variant: variant.result.books.relative_residual,
        form="power",
        column=Column("", 1.0, ".1e"),
        page=True,
    ),
    Measure(
        key="energy_throughput",
        symbol="E",
        unit="J",
        definition="All energy supplied or taken from a store.",
        read=lambda variant: variant.result.books.throughput,
    ),
    Measure(
        key="degrees_of_freedom",
        symbol="n",
        definition="Modes and rigid motions of all bodies.",
        read=lambda variant: variant.modes,
        column=Column("", 1.0, "d"),
        page=True,
        kind="whole",
    ),
    Measure(
        key="steps",
        symbol="n_t",
        definition="Time steps of the run for elements and fluid, macro steps and fine ones.",
        read=lambda variant: variant.result.coarse_steps + variant.result.steps.fine,
        column=Column("", 1.0, "d"),
        kind="whole",
    ),
    Measure(
        key="fine_steps",
        symbol="n_f",
        definition="Fine time steps of the bodies.",
        read=lambda variant: variant.result.fine_steps,
        kind="whole",
    ),
    Measure(
        key="coarse_steps",
        symbol="n_c",
        definition="Macro steps: elements and fluid are evaluated once in each.",
        read=lambda variant: variant.result.coarse_steps,
        kind="whole",
    ),
    Measure(
        key="step",
        symbol="dt",
        unit="s",
        definition="Length of a fine time step.",
        read=lambda variant: variant.result.step,
        digits=3,
        page=True,
        title="shortest time step",
    ),
    Measure(
        key="wall_time",
        unit="s",
        definition="Wall time of the time loop.",
        read=lambda variant: variant.result.wall_time,
        digits=3,
        column=Column("s", 1.0, ".3g"),
        page=True,
        title="computing time",
        remark=lambda variant: f"\n{pace(variant)}",
    ),
    Measure(
        key="real_time_factor",
        name="real-time factor",
        definition="Wall time of the time loop, on one core, over the simulated time.",
        read=real_time_factor,
        form="fixed",
        digits=3,
        column=Column("", 1.0, ".3g"),
    ),
    Measure(
        key="setup_time",
        unit="s",
        definition="Wall time of everything before the time loop.",
        digits=3,
    ),
)
"""Of one variant; opening and closing are those of the needle."""

DELIVERY_MEASURES: tuple[Measure[Delivery], ...] = described_in(
    "theory/stroke",
    Measure(
        key="mass",
        symbol="m",
        unit="kg",
        definition="Net mass from port a to port b: in the whole run, or from the start of one "
        "command of the driver to the start of the next.",
        column=Column("mg", 1e6, ".5g"),
        remark=lambda found: " (flows on)" if found.flows_on else "",
        page=True,
    ),
    Measure(
        key="volume",
        symbol="V",
        unit="m^3",
        definition="That mass over the density at ambient pressure; for a liquid at its own "
        "temperature, for a gas at the ambient temperature.",
        column=Column("mm^3", 1e9, ".5g"),
        page=True,
    ),
    Measure(
        key="back_mass",
        symbol="m_b",
        unit="kg",
        definition="Mass that flows against the net direction, as far as the records resolve it.",
        column=Column("mg", 1e6, ".3g", "back"),
        page=True,
        title="flows back",
    ),
    Measure(
        key="peak_flow",
        symbol="q_max",
        unit="kg/s",
        definition="Largest mass flow, mean over a record.",
    ),
    Measure(
        key="steady_flow",
        symbol="q",
        unit="kg/s",
        definition="Median of the mass flow while it is above half of its largest value; "
        "missing if the flow differs from it by more than 5 % for half of that time, as in a "
        "ballistic pulse.",
        column=Column("g/s", 1e3, ".4g"),
        page=True,
    ),
    Measure(
        key="initial_flow",
        symbol="q_0",
        unit="kg/s",
        definition="Mass flow in the first record: the leakage of a closed seat.",
    ),
    Measure(
        key="final_flow",
        symbol="q_e",
        unit="kg/s",
        definition="Mass flow in the last record.",
    ),
    Measure(
        key="first_flow",
        symbol="t_f",
        unit="s",
        definition="Time at which the mass flow has risen by 1 % of its largest rise above the "
        "initial flow; missing if it does not rise, or if it is above half its largest value "
        "from the start.",
        digits=5,
        column=Column("ms", 1e3, ".4f"),
        page=True,
    ),
    Measure(
        key="flow_delay",
        symbol="t_d",
        unit="s",
        definition="From the start of the command of the nearest driver to the first flow; for "
        "the whole run from its first command (or one before the run, if the flow begins "
        "earlier).",
        column=Column("us", 1e6, ".5g", "delay"),
        page=True,
    ),
    Measure(
        key="last_flow",
        symbol="t_l",
        unit="s",
        definition="Time at which it has fallen to that level for good, or to within 1 % of its "
        "last value if it flowed from the start; missing if it still flows at the end.",
        digits=5,
        column=Column("ms", 1e3, ".4f"),
        page=True,
    ),
    Measure(
        key="opening_pressure",
        symbol="dp_o",
        unit="Pa",
        definition="Pressure upstream minus downstream of the restriction at the first flow.",
        page=True,
    ),
    Measure(
        key="closing_pressure",
        symbol="dp_c",
        unit="Pa",
        definition="The same at the last flow.",
        page=True,
    ),
    Measure(
        key="hysteresis",
        symbol="dp_h",
        unit="Pa",
        definition="Opening pressure minus closing pressure.",
    ),
)
"""Of what one restriction passes; flows from its port a to its port b are positive."""
