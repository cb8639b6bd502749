"""All groups of checks, in a fixed order."""

from collections.abc import Callable, Iterable, Iterator
from importlib import import_module
from pathlib import Path
from traceback import extract_tb

from klack.errors import InputError, KlackError
from klack.verification.check import Check

__all__ = ["COVERS", "GROUPS", "iterate_checks", "run_checks"]

COVERS = {
    "elasticity": "Finite elements against exact elasticity: free cylinder, bending of bodies of "
    "revolution, tube, rod, beam; and the direct solvers against each other.",
    "contact": "Static contact of meshed bodies: Hertz, patch test, gap between curved faces, "
    "local law, reciprocity.",
    "reduction": "What a reduced body keeps of the full one: static compliance, receptance, "
    "mass, and what truncation misses.",
    "integrator": "Time integration of reduced bodies: exact modes, order of convergence, energy "
    "and momentum.",
    "impact": "Reduced impacts against closed and tabulated solutions: Hertz, St Venant, "
    "needle on a spring, Zener.",
    "transient": "Full-order impact with set-valued contact: rods, a blocked bar, a sphere on a "
    "thick block.",
    "interface": "Contact point by point on modal bodies: statics, Hertz impacts, sub-impacts, "
    "guides, energy over many impacts.",
    "friction": "Coulomb friction between the faces: partial slip, oblique impacts, seats, jams.",
    "plasticity": "Faces that yield: one point, spheres and a seat on finite elements, running-in, "
    "impacts in time.",
    "off-axis": "A needle in space: films that tilt, films in its guide, magnet and seat, drops "
    "and starts in a network, faces that rub.",
    "spectra": "Spectra of pulses, Parseval, and one-third-octave bands of IEC 61260-1.",
    "vibration": "Mobility, force on the support, energy injected, plates, and radiation of "
    "pistons.",
    "sound": "From force to ear: one-third octaves, weighting, levels, and loudness of ISO 532-1.",
    "measurement": "Lift sensor, differentiation and impacts found in records of exact flights.",
    "measured": "Measurements of others: strain pulses of struck bars, oblique impacts of spheres.",
    "mechanics": "Mass, spring, friction, gravity and forces in the time loop, against closed "
    "motions.",
    "mechanical-parts": "Nonlinear springs, surge, rubber, LuGre friction and levers "
    "against closed and independent solutions.",
    "fluids": "Density, sound speed and viscosity against reference data; gas, vapour, and "
    "the table of the kernel.",
    "fluid-data": "Fluids against published values over temperature and pressure, and their "
    "viscosity under pressure.",
    "hydraulics": "Orifices, gaps, seats, annuli, chambers and inertances against closed formulas.",
    "hydraulic-parts": "Check and relief valves, accumulators, pumps, spool edges, fittings, "
    "walls: formulas, and small networks integrated apart.",
    "pneumatics": "Gas: flow laws of ISO 6358, vessels that fill and empty, and networks "
    "integrated apart.",
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
    "control": "Sensors, PID, hysteresis, state machines and functions of the user, against exact "
    "recursions.",
    "network": "A whole valve in one time loop: energy balance of all domains, restart, step "
    "sizes, one law after the other.",
    "cases": "Case files: units by their definitions, expressions, included parts of networks.",
    "heat": "Heat networks and warm-up: exact decays, pulses, Modelica's examples, copper that "
    "heats itself, and every stroke of a warm-up computed.",
    "operating-point": "Where a valve rests: springs, magnets, restrictions and both together "
    "against solutions by hand, networks of SciPy, and runs that stay there.",
    "linearisation": "Linear models of valves: closed forms, Routh's boundary, pipes by delay "
    "theory, reciprocity, and small motions in time.",
    "exchange": "What goes out to other programs and comes back: meshes, matrices, state space, "
    "FMI.",
}
"""Group -> what it covers, in one sentence."""

GROUPS = tuple(COVERS)
"""Modules in this package, by name, with hyphens; each has ``checks() -> list[Check]``."""


def run_checks(groups: Iterable[str] | None = None) -> list[Check]:
    """Run the checks of the given groups (all by default).

    A group that stops with an error counts as one failed check; the others still run.
    """
    return [check for _, checks in iterate_checks(groups) for check in checks]


def iterate_checks(
    groups: Iterable[str] | None = None, started: Callable[[str], None] = lambda group: None
) -> Iterator[tuple[str, list[Check]]]:
    """Yield group after group with its checks, as they finish; ``started`` receives each name."""
    for group in _known(groups):
        started(group)
        module = import_module(f"klack.verification.{group.replace('-', '_')}")
        try:
            checks = list(module.checks())
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
    """Origin of an unexpected error: the innermost lines of this package."""
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
