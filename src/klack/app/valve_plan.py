"""State of the guide for a new valve, kept until it is a case."""

import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

from klack.app.answers import Proposal
from klack.app.folder import OpenFolder
from klack.errors import InputError

__all__ = ["BODIES", "EXAMPLES", "STEPS", "Plans", "ValvePlan"]

BODIES = ("needle", "housing")
"""Moving body, and the one that it hits."""

STEPS = ("Parts", "Faces", "Materials", "Motion", "Check", "Case")

_FILE = "new-valve.json"
_LONGEST = 100_000  # characters of a table
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,60}")

EXAMPLES = {
    "needle": """r, z, surface, centre r, centre z
0, -0.6
0.6, 0, tip, 0, 0
2.5, 1.9, taper
2.5, 15, shaft
5, 15, disc_bottom
5, 19.4, disc_rim
0, 19.4, top
""",
    "housing": """r, z, surface
0.24, -1.8
6.5, -1.8, bottom
6.5, 2, outside
6.5, 5, rim
5, 5, top
5, -0.1485, inside
0.7, -0.1485, floor
0.24, -0.6085, seat
0.24, -1.8, bore
""",
}
"""Parts of the demo valve, a small solenoid valve."""


@dataclass(frozen=True, kw_only=True)
class ValvePlan:
    """All choices of the guide; only their kind is checked here.

    Parameters
    ----------
    name
        Of the folder for the case.
    step
        Where the guide stands.
    source
        ``"step"`` or ``"table"``.
    needle_file, housing_file
        STEP files by their path from the folder.
    needle_label, housing_label
        Names that uploaded files had.
    needle_table, housing_table
        Rows of a drawing, see :mod:`klack.app.parts`.
    model
        ``"half"`` for the half section of turned parts, ``"solid"``.
    needle_contact, housing_contact
        Faces that meet.
    held, radiating
        Faces of the housing; all others radiate where none is chosen.
    needle_material, housing_material
        Of the library.
    speed, force, gap
        Quantities with their units.
    noise
        Whether mount and plate are assumed, so that the click can be played.
    """

    name: str = "my-valve"
    step: int = 0
    source: str = "step"
    needle_file: str = ""
    housing_file: str = ""
    needle_label: str = ""
    housing_label: str = ""
    needle_table: str = ""
    housing_table: str = ""
    model: str = "half"
    needle_contact: str = ""
    housing_contact: str = ""
    held: tuple[str, ...] = ()
    radiating: tuple[str, ...] = ()
    needle_material: str = "X46Cr13 hardened"
    housing_material: str = "X46Cr13 hardened"
    speed: str = "0.3 m/s"
    force: str = "10 N"
    gap: str = "0 um"
    noise: bool = True

    def of(self, body: str, what: str) -> str:
        """A choice for one body: ``file``, ``label``, ``table``, ``contact`` or ``material``."""
        return str(getattr(self, f"{body}_{what}"))

    def given(self, body: str) -> str:
        """File or drawing of a body; empty without one."""
        return self.of(body, "file" if self.source == "step" else "table")

    def with_body(self, body: str, what: str, value: str) -> "ValvePlan":
        """The same with another choice for one body."""
        changed: dict[str, Any] = {f"{body}_{what}": value}
        return replace(self, **changed)

    @property
    def roles(self) -> dict[str, str]:
        """``"contact"``, ``"held"`` or ``"radiating"`` by face, ``needle.tip``."""
        found = {f"housing.{face}": "radiating" for face in self.radiating}
        found |= {f"housing.{face}": "held" for face in self.held}
        found |= {
            f"{body}.{self.of(body, 'contact')}": "contact"
            for body in BODIES
            if self.of(body, "contact")
        }
        return found

    def with_role(self, body: str, face: str, role: str) -> "ValvePlan":
        """The same with a face in another role, or none; a body has one contact face."""
        plan = self
        if plan.of(body, "contact") == face:
            plan = plan.with_body(body, "contact", "")
        if role == "contact":
            plan = plan.with_body(body, "contact", face)
        if body == "needle":
            return plan
        held = tuple(other for other in plan.held if other != face)
        radiating = tuple(other for other in plan.radiating if other != face)
        return replace(
            plan,
            held=(*held, face) if role == "held" else held,
            radiating=(*radiating, face) if role == "radiating" else radiating,
        )

    def with_faces(self, known: Mapping[str, tuple[str, ...]]) -> "ValvePlan":
        """The same without unknown faces."""
        plan = self
        for body in BODIES:
            if plan.of(body, "contact") not in known.get(body, ()):
                plan = plan.with_body(body, "contact", "")
        own = known.get("housing", ())
        return replace(
            plan,
            held=tuple(face for face in plan.held if face in own),
            radiating=tuple(face for face in plan.radiating if face in own),
        )

    def with_proposal(self, found: Proposal) -> "ValvePlan":
        """The same with proposed faces."""
        return replace(
            self,
            needle_contact=found.needle_contact,
            housing_contact=found.housing_contact,
            held=(found.held,) if found.held else (),
        )

    def require_name(self) -> None:
        """Refuse a name that is no plain name of a folder."""
        if not _NAME.fullmatch(self.name):
            raise InputError(
                "name of the valve",
                got=f"'{self.name[:80]}'",
                expected="letters, digits, - and _, 61 at most",
                hint="my-valve",
            )


class Plans:
    """Plan of a folder, in ``.klack-app``; whole at every moment."""

    def __init__(self, folder: OpenFolder) -> None:
        self._folder = folder

    def load(self) -> ValvePlan:
        """The last plan; a new one if it is missing or damaged."""
        return _plan_of(self._folder.own_json(_FILE))

    def keep(self, plan: ValvePlan) -> None:
        """Keep a plan, unless a table is too long."""
        for body in BODIES:
            if len(plan.of(body, "table")) > _LONGEST:
                raise InputError(
                    f"drawing of the {body}",
                    got=f"{len(plan.of(body, 'table'))} characters",
                    expected=f"at most {_LONGEST}",
                    hint="provide such a body as a STEP file or a mesh.",
                )
        self._folder.keep(_FILE, json.dumps(asdict(plan)).encode())

    def forget(self) -> None:
        """Begin anew."""
        self._folder.keep(_FILE, None)


def _plan_of(found: Mapping[str, Any]) -> ValvePlan:
    """Plan of valid keys; others keep their default."""
    plan = ValvePlan()
    values: dict[str, Any] = {}
    for item in fields(plan):
        value, usual = found.get(item.name), getattr(plan, item.name)
        if isinstance(usual, tuple) and isinstance(value, list):
            values[item.name] = tuple(str(one) for one in value)
        elif type(value) is type(usual) and not isinstance(usual, tuple):
            values[item.name] = value
    plan = replace(plan, **values)
    return replace(plan, step=min(max(plan.step, 0), len(STEPS) - 1))
