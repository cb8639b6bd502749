"""All groups of checks, in a fixed order."""

from collections.abc import Callable, Iterable, Iterator
from importlib import import_module

from klack.errors import InputError, KlackError
from klack.verification.check import Check

__all__ = ["GROUPS", "iterate_checks", "run_checks"]

GROUPS = (
    "elasticity",
    "contact",
    "reduction",
    "integrator",
    "impact",
    "transient",
    "interface",
    "spectra",
    "vibration",
    "sound",
    "measurement",
    "mechanics",
    "fluids",
    "hydraulics",
    "lines",
    "films",
    "magnetics",
    "drivers",
    "network",
    "exchange",
)
"""Module names in this package; each has ``checks() -> list[Check]``."""


def run_checks(groups: Iterable[str] | None = None) -> list[Check]:
    """Run the checks of the given groups (all by default).

    A group that stops with an error of klack counts as one failed check; the others still run.
    """
    return [check for _, checks in iterate_checks(groups) for check in checks]


def iterate_checks(
    groups: Iterable[str] | None = None, started: Callable[[str], None] = lambda group: None
) -> Iterator[tuple[str, list[Check]]]:
    """Yield group after group with its checks, as they finish; ``started`` is told each name."""
    for group in _known(groups):
        started(group)
        module = import_module(f"klack.verification.{group}")
        try:
            checks = list(module.checks())
        except KlackError as error:
            checks = [_stopped(group, str(error))]
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


def _stopped(group: str, reason: str) -> Check:
    nan = float("nan")
    return Check(
        group=group,
        name=f"runs to its end ({' '.join(reason.split())})",
        expected=0.0,
        computed=nan,
        deviation=nan,
        tolerance=0.0,
        source="klack",
    )
