"""Thermal classes of electrical insulation."""

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

__all__ = ["CLASS_TEMPERATURES", "USUAL_CLASS", "InsulationClass"]

CLASS_TEMPERATURES: Mapping[str, float] = {
    "Y": 363.15,
    "A": 378.15,
    "E": 393.15,
    "B": 403.15,
    "F": 428.15,
    "H": 453.15,
    "N": 473.15,
    "R": 493.15,
    "250": 523.15,
}
"""Highest temperature of continuous use [K]; IEC 60085:2007, table 1 (90 to 250 degC).

The standard itself is not public.  The numbers agree with the table of classes Y to R in
"Insulation system", Wikipedia (which cites IEC 60085), classes Y to H with that of Croylek Ltd.,
"Temperature classes of electrical insulation", and 105 to 250 with R. Beeckman, "NEMA magnet wire
thermal class ratings", Essex Group.
"""

USUAL_CLASS = "H"
"""Class of the enamelled wire of most solenoids of valves, for a coil without a class."""

InsulationClass = Annotated[
    Literal["Y", "A", "E", "B", "F", "H", "N", "R", "250"] | None,
    Field(
        description="Thermal class of its insulation after IEC 60085: Y 90, A 105, E 120, B "
        "130, F 155, H 180, N 200, R 220 or 250 degC. klack heat warns of copper above it; "
        "without a class, above 180 degC."
    ),
]
"""Key of a coil."""
