"""One comparison of a computed number with a known one, and all groups of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from math import isfinite
from pathlib import Path
from traceback import extract_tb
from typing import TYPE_CHECKING

from klack.errors import InputError, KlackError

if TYPE_CHECKING:  # the command line names the groups and must start quickly
    import numpy as np
    from numpy.typing import NDArray

__all__ = [
    "COVERS",
    "GROUPS",
    "LARGEST_HEADROOM",
    "Check",
    "ComparedCurve",
    "check",
    "compare",
    "deviation_text",
    "headroom_text",
    "iterate_checks",
    "number_text",
    "run_checks",
    "summary",
    "tolerance_text",
]


LARGEST_HEADROOM = 100.0
"""A tolerance of more than so many deviations needs a reason."""

_UNIT = re.compile(r"\[([^\[\]]+)\]$")

_ROUND_OFF = 1e-15  # a few units in the last place; no deviation counts for less


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ComparedCurve:
    """Whole curve of which a check compares one number: abscissae and values, known and computed.

    Labels have units: ``"time [us]"``; both have abscissae of their own.
    """

    x_label: str
    y_label: str
    expected: tuple[NDArray[np.float64], NDArray[np.float64]]
    computed: tuple[NDArray[np.float64], NDArray[np.float64]]
    x_log: bool = False
    y_log: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """A verdict that anyone can recompute.

    Parameters
    ----------
    group, name
        Domain (``"elasticity"``) and what is compared (with the unit).
    deviation
        Relative to ``expected``, or absolute where that is zero or ``absolute`` was given.
    tolerance
        Of the magnitude of ``deviation``.
    source
        Author, year, equation or table; or the closed formula.
    reason
        Why the tolerance is as wide as it is, above :data:`LARGEST_HEADROOM`: the digits of a
        printed table, the scatter of a standard.
    curve
        Several checks may share one.
    """

    group: str
    name: str
    expected: float
    computed: float
    deviation: float
    tolerance: float
    source: str
    reason: str = ""
    curve: ComparedCurve | None = None
    is_absolute: bool = False

    @property
    def passed(self) -> bool:
        """True when the deviation is within the tolerance (nan fails)."""
        return bool(abs(self.deviation) <= self.tolerance)

    @property
    def unit(self) -> str:
        """Unit in brackets at the end of the name; empty for pure numbers.

        >>> compare("a", "time [s]", expected=1, computed=1, tolerance=0, source="").unit
        's'
        """
        found = _UNIT.search(self.name)
        return "" if found is None or found[1] == "-" else found[1]

    @property
    def deviation_unit(self) -> str:
        """``"relative"``, the unit, or else ``"absolute"``."""
        if not self.is_absolute or "relative" in self.name or " over " in self.unit:
            return "relative"
        return self.unit or "absolute"

    @property
    def headroom(self) -> float:
        """Tolerance over deviation; nan for a check not run.

        Deviations below round-off count as round-off.
        """
        return float(self.tolerance / max(abs(self.deviation), _ROUND_OFF))

    @property
    def is_wide(self) -> bool:
        """True where :data:`LARGEST_HEADROOM` is passed without a reason."""
        return self.headroom > LARGEST_HEADROOM and not self.reason


def compare(
    group: str,
    name: str,
    expected: float,
    computed: float,
    tolerance: float,
    source: str,
    curve: ComparedCurve | None = None,
    *,
    absolute: bool = False,
    reason: str = "",
) -> Check:
    """Build a :class:`Check`; relative unless ``absolute`` or an expected zero."""
    difference = computed - expected
    is_absolute = absolute or expected == 0
    deviation = difference if is_absolute else difference / abs(expected)
    return Check(
        group=group,
        name=name,
        expected=float(expected),
        computed=float(computed),
        deviation=float(deviation),
        tolerance=tolerance,
        source=source,
        reason=reason,
        curve=curve,
        is_absolute=is_absolute,
    )


check = partial(compare, "")
"""The same without its group."""


def summary(checks: Sequence[Check]) -> str:
    """Passed checks, and wide tolerances without a reason."""
    passed = sum(check.passed for check in checks)
    wide = sum(check.is_wide for check in checks)
    return f"{passed} of {len(checks)} checks passed" + (
        f"; {wide} with a tolerance that is wide without a reason" if wide else ""
    )


def number_text(value: float) -> str:
    """Six digits, or ``none`` where there is no number."""
    return f"{value:.6g}" if isfinite(value) else "none"


def deviation_text(check: Check) -> str:
    """With sign and kind: ``+1.2e-06 relative``, ``-3.0e-09 m``.

    >>> from klack.verification.check import compare
    >>> deviation_text(compare("a", "gap [m]", expected=0, computed=1e-9, tolerance=1, source=""))
    '+1.0e-09 m'
    """
    if not isfinite(check.deviation):
        return "none"
    value = f"{check.deviation:+.1e}" if check.deviation else "0"
    return f"{value} {check.deviation_unit}"


def tolerance_text(check: Check) -> str:
    """Largest accepted deviation, in the unit of the deviation."""
    return f"{check.tolerance:.1e}" if check.tolerance else "0"


def headroom_text(check: Check) -> str:
    """Tolerance over deviation: ``x 3.2``; ``exact`` where neither is above zero."""
    if not isfinite(check.headroom):
        return "none"
    if check.tolerance == 0:
        return "exact" if check.passed else "none"
    if check.headroom < 1000:
        return f"x {check.headroom:.2g}" if check.headroom < 100 else f"x {check.headroom:.0f}"
    return f"x {check.headroom:.0e}"


COVERS = {
    "elasticity": "Finite elements against exact elasticity: free cylinder, bending of bodies of "
    "revolution, tube, rod, beam; and the direct solvers against each other.",
    "contact": "Static contact of meshed bodies: Hertz, patch test, gap between curved faces, "
    "local law, reciprocity.",
    "reduction": "Reduced bodies against full ones: static compliance, receptance, mass, and "
    "the error of truncation.",
    "integrator": "Time integration of reduced bodies: exact modes, order of convergence, energy "
    "and momentum.",
    "impact": "Reduced impacts against closed-form and tabulated solutions: Hertz, St Venant, "
    "needle on a spring, Zener; a bar that bounces, at all levels.",
    "transient": "Full-order impact with set-valued contact: rods, a blocked bar, a sphere on a "
    "thick block.",
    "interface": "Contact point by point on modal bodies: statics, Hertz impacts, sub-impacts, "
    "guides, energy over many impacts.",
    "friction": "Coulomb friction between the faces: partial slip, oblique impacts, seats, jams.",
    "plasticity": "Faces that yield: one point, spheres and a seat on finite elements, running-in, "
    "impacts in time.",
    "off-axis": "A needle in three dimensions: tilting films, films in its guide, magnet and "
    "seat, drops and starts in a network, faces with friction.",
    "spectra": "Spectra of pulses, Parseval, and one-third-octave bands of IEC 61260-1.",
    "vibration": "Mobility, force on the support, energy injected, plates, and radiation of "
    "pistons.",
    "sound": "From force to ear: one-third octaves, weighting, levels, and loudness of ISO 532-1.",
    "structure-borne": "A source on a receiver: rods and beams joined, plates, isolators, "
    "blocked forces, reception plates of EN 15657, time signals.",
    "radiation": "Sound of moving surfaces by boundary elements: spheres, cylinders, small rigid "
    "bodies.",
    "measurement": "Lift sensor, differentiation and impacts found in records of exact flights.",
    "measured": "Published measurements: strain pulses of struck bars, oblique impacts of "
    "spheres, bounces in liquids, waves in rock, a magnet.",
    "mechanics": "Mass, spring, friction, gravity and forces in the time loop, against "
    "closed-form motions.",
    "mechanical-parts": "Nonlinear springs, surge, rubber, LuGre friction and levers against "
    "closed-form and independent solutions.",
    "fluids": "Density, sound speed and viscosity against reference data; gas, vapour, and "
    "the table of the kernel.",
    "fluid-data": "Fluids against published values over temperature and pressure, and their "
    "viscosity under pressure.",
    "hydraulics": "Orifices, gaps, seats, annuli, chambers and inertances against closed formulas.",
    "hydraulic-parts": "Check and relief valves, accumulators, pumps, spool edges, fittings, "
    "walls: formulas, and small networks integrated independently.",
    "pneumatics": "Gas: flow laws of ISO 6358, vessels that fill and empty, and networks "
    "integrated independently.",
    "lines": "Water hammer: Joukowsky, echoes, laminar friction of Zielke, cavities, energy, "
    "junctions, turbulent lines, local properties.",
    "films": "Squeeze films between faces: Reynolds' equation, impulse, fall, series "
    "compliance, order.",
    "magnetics": "Magnetic circuits at rest: force, co-energy, iron curves, edge fields, eddy "
    "ladders, a published lifting magnet.",
    "magnetic-parts": "Parts of a magnetic circuit: hysteresis of the iron, permanent magnets, "
    "maps from files.",
    "drivers": "Coils in time: currents, switchings inside steps, eddy currents, motion, energy.",
    "output-stage": "Coils behind an output stage: boost capacitor, recuperation, diodes, "
    "clamp, a second shot.",
    "control": "Sensors, PID, hysteresis, state machines and user functions, against exact "
    "recursions.",
    "network": "A whole valve in one time loop: energy balance of all domains, restart, step "
    "sizes, and single laws.",
    "cases": "Case files: units by their definitions, expressions, included parts of networks.",
    "heat": "Heat networks and warm-up: exact decays, pulses, Modelica's examples, self-heating "
    "copper, and a warm-up with every stroke computed.",
    "operating-point": "Valves at rest: springs, magnets, restrictions and their combinations "
    "against solutions by hand, networks in SciPy, and runs that stay at rest.",
    "linearisation": "Linear models of valves: closed forms, Routh's boundary, pipes with "
    "delays, reciprocity, and small motions in time.",
    "exchange": "Exports to other programs and their results read back: meshes, matrices, state "
    "space, FMI.",
}
"""Group -> what it covers, in one sentence."""

GROUPS = tuple(COVERS)
"""Modules of this package, with hyphens; each has ``checks() -> list[Check]``."""


def run_checks(groups: Iterable[str] | None = None) -> list[Check]:
    """Run the checks of the given groups (all by default).

    A group that stops with an error counts as one failed check.
    """
    return [check for _, checks in iterate_checks(groups) for check in checks]


def iterate_checks(
    groups: Iterable[str] | None = None, started: Callable[[str], None] = lambda group: None
) -> Iterator[tuple[str, list[Check]]]:
    """Group after group with its checks, as they finish; ``started`` gets each name."""
    for group in _known(groups):
        started(group)
        module = import_module(f"klack.verification.{group.replace('-', '_')}")
        try:
            checks = [replace(check, group=group) for check in module.checks()]
        except KlackError as error:
            checks = [_stopped(group, str(error))]
        except Exception as error:  # an internal error may not cost the other groups
            checks = [_stopped(group, f"{type(error).__name__}: {error}", _place(error))]
        yield group, checks or [_stopped(group, "the group has no checks")]


def _known(groups: Iterable[str] | None) -> tuple[str, ...]:
    if groups is None:
        return GROUPS
    wanted = tuple(groups)
    for group in wanted:
        if group not in GROUPS:
            raise InputError(
                "group",
                got=f"'{group}'",
                expected=f"one of: {', '.join(GROUPS)}",
                hint="klack verify without --group runs them all.",
            )
    return tuple(group for group in GROUPS if group in wanted)


def _place(error: Exception) -> str:
    """Innermost lines of this package in an unexpected error."""
    frames = extract_tb(error.__traceback__)
    return " < ".join(f"{Path(f.filename).name}:{f.lineno}" for f in reversed(frames[-4:]))


def _stopped(group: str, why: str, place: str = "") -> Check:
    nan = float("nan")
    return Check(
        group=group,
        name=f"runs to its end ({' '.join(why.split())})",
        expected=0.0,
        computed=nan,
        deviation=nan,
        tolerance=0.0,
        source="klack",
        reason=place,
    )
