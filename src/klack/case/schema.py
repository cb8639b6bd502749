"""A case: two bodies, their contact, and what shall be computed."""

from collections.abc import Iterable
from typing import Self

from pydantic import model_validator

from klack.case.consistency import BACKING_LEVELS, check_consistency, check_noise
from klack.case.impact_sections import ImpactSections
from klack.case.levels import LEVELS, OBLIQUE_LEVELS, OFF_AXIS_LEVELS, ROUGH_LEVELS, Level
from klack.errors import InputError, refuse_if
from klack.input.problem import nearest, one_of
from klack.units import format_si

__all__ = ["Case"]


class Case(ImpactSections):
    """One impact of two bodies, from geometry to results."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        check_consistency(self)
        check_noise(self)
        return self

    def require_levels(self, levels: Iterable[str]) -> tuple[Level, ...]:
        """Check that this case can run the levels; each once."""
        wanted = tuple(dict.fromkeys(levels))
        for level in wanted:
            if level != "full":
                self.require_ends(f"the level '{level}'")
            if level not in LEVELS:
                raise InputError(
                    "level",
                    got=f"'{level}'",
                    expected=f"one of: {one_of(LEVELS)}",
                    hint=nearest(level, LEVELS, "see klack impact --help."),
                )
            refuse_if(
                level == "lumped" and self.lumped is None,
                f"{self._path or 'case'}: lumped",
                got="no section 'lumped'",
                expected="its stiffness, required by the level 'lumped'",
                hint="add 'lumped: {stiffness: 1e9 N/m}'.",
            )
        for level in wanted:
            if level not in BACKING_LEVELS:
                self.require_pair(f"the level '{level}'")
        left_out = [level for level in wanted if level not in ROUGH_LEVELS]
        if self.contact.roughness is not None and left_out:
            raise InputError(
                f"{self._path or 'case'}: contact.roughness",
                got=f"rough faces at the level '{left_out[0]}'",
                expected=f"levels with a layer of asperities: {one_of(ROUGH_LEVELS)}",
                hint="leave the level out, or the roughness.",
            )
        along = [level for level in wanted if level not in OBLIQUE_LEVELS]
        if along:
            self.require_straight(f"the level '{along[0]}'", "--level interface, or full of solids")
        on_axis = [level for level in wanted if level not in OFF_AXIS_LEVELS]
        if self.leaves_axis and on_axis:
            raise self._off_axis(f"the level '{on_axis[0]}'")
        return tuple(level for level in LEVELS if level in wanted)

    def require_pair(self, what: str) -> None:
        """Reject a third body behind the struck one."""
        refuse_if(
            self.backing is not None,
            f"{self._path or 'case'}: backing",
            got=f"{what} of three bodies in a row",
            expected=f"klack impact with --level {one_of(BACKING_LEVELS)}",
            hint="use that, or klack stroke; or draw the struck body and the one behind it "
            "as one glued body (how-to/two-materials), without 'backing'.",
        )

    def require_on_axis(self, what: str) -> None:
        """Reject off-axis axisymmetric bodies, oblique motion and a body behind the struck one."""
        self.require_pair(what)
        self.require_straight(what)
        if self.leaves_axis:
            raise self._off_axis(what)

    def require_straight(self, what: str, levels: str = "--level interface") -> None:
        """Reject motion across z and spin, which models along the axis leave out."""
        motion = self.motion
        if motion.is_straight:
            return
        key = "sideways_speed" if motion.sideways_speed else "spin"
        value = motion.sideways_speed if motion.sideways_speed else max(map(abs, motion.spin))
        raise InputError(
            f"{self._path or 'case'}: motion.{key}",
            got=f"{what} of a body with {format_si(value, 'm/s' if key != 'spin' else 'rad/s')}",
            expected=f"klack impact with {levels}, whose bodies move in all directions",
            hint="use that (in a study: level: interface), or remove motion.sideways_speed and "
            "motion.spin.",
        )

    def _off_axis(self, what: str) -> InputError:
        return InputError(
            f"{self._path or 'case'}: motion.placement",
            got=f"{what} of axisymmetric bodies off-axis",
            expected="klack impact with --level interface, which moves them in all directions",
            hint="use that level, or 'model: swept' with 'layers: 18' for both bodies.",
        )

    def require_ends(self, what: str) -> None:
        """Reject a non-reflecting end, which modes, exports and decks leave out."""
        for name, body in self.bodies.items():
            refuse_if(
                body.non_reflecting is not None,
                f"{self._path or 'case'}: bodies.{name}.non_reflecting",
                got=f"{what} of a body with a non-reflecting end",
                expected="klack impact with --level full",
                hint="remove the end, and make the bar long enough that no echo returns "
                "during the run.",
            )
