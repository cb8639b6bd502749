"""Options of ``klack stroke --steady``."""

from dataclasses import dataclass
from typing import Annotated, Literal

from cyclopts import Parameter

from klack.errors import InputError

__all__ = ["STEADY", "SteadyAsked"]

_Texts = list[str] | None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class SteadyAsked:
    """Operating point in place of an actuation."""

    steady: Annotated[
        bool,
        Parameter(
            name="--steady",
            negative="",
            help="Compute the operating point at the start instead, with everything that drives "
            "the valve constant.",
        ),
    ] = False
    current: Annotated[
        _Texts,
        Parameter(
            name="--current",
            allow_leading_hyphen=True,
            negative="",
            help='With --steady: current of all coils, "3 A", or of one, "coil=3 A". [default: '
            "as at the start of a run]",
        ),
    ] = None
    voltage: Annotated[
        _Texts,
        Parameter(
            name="--voltage",
            allow_leading_hyphen=True,
            negative="",
            help="With --steady: voltage, instead of a current.",
        ),
    ] = None
    lift: Annotated[
        str | None,
        Parameter(
            name="--lift",
            allow_leading_hyphen=True,
            help='With --steady: hold the needle at this displacement, "40 um".',
        ),
    ] = None
    sweep: Annotated[
        list[tuple[str, str, str, int]] | None,
        Parameter(
            name="--sweep",
            allow_leading_hyphen=True,
            negative="",
            help="With --steady: a key of the case, or lift, current or voltage, then from, to "
            'and the number of values: --sweep lift "0 um" "80 um" 9. Twice for two of them.',
        ),
    ] = None
    origin: Annotated[
        Literal["start", "far"],
        Parameter(
            name="--from",
            help="With --steady: begin the search with the bodies where they are drawn, or at the "
            "stops far from there.",
        ),
    ] = "start"
    over: Annotated[
        str | None,
        Parameter(
            name="--over",
            help='With --sweep: quantity on the x axis, "tank volume flow". [default: the first '
            "sweep]",
        ),
    ] = None
    show: Annotated[
        _Texts,
        Parameter(
            name="--show",
            negative="",
            help='With --sweep: quantity to draw, "coil armature force"; repeatable. [default: '
            "the main ones]",
        ),
    ] = None

    def require_fitting(self, **others: object) -> None:
        """Refuse options of an actuation with --steady, and of --steady without it."""
        names = {"continued": "continue", "check_steps": "check-steps"}
        if self.steady:
            given = [f"--{names.get(name, name)}" for name, x in others.items() if x is not None]
            if given:
                raise InputError(
                    given[0],
                    got="a value together with --steady",
                    expected="none: an operating point has no time",
                    hint=f"leave {given[0]} out, or --steady.",
                )
        own = {
            "--current": self.current,
            "--voltage": self.voltage,
            "--lift": self.lift,
            "--sweep": self.sweep,
            "--from": None if self.origin == "start" else self.origin,
        }
        drawn = {"--over": self.over, "--show": self.show}
        for needed, present, options in (
            ("--steady", self.steady, own),
            ("--sweep", bool(self.sweep), drawn),
        ):
            alone = [name for name, value in options.items() if value]
            if alone and not present:
                raise InputError(
                    alone[0],
                    got=f"a value without {needed}",
                    expected=f"{needed} beside it",
                    hint=f"add {needed}, or leave {alone[0]} out.",
                )


STEADY = SteadyAsked()
"""Without any of them."""
