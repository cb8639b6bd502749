r"""Elastic walls of chambers and lines: by how much the volume grows with the pressure."""

from math import inf
from typing import Literal, Self

from pydantic import Field, model_validator

from klack.input.problem import CaseProblem
from klack.input.section import Section
from klack.units import Length, Modulus, Ratio

__all__ = ["Ends", "Wall", "tube_compliance"]

Ends = Literal["closed", "fixed", "sliding"]


def tube_compliance(
    diameter: float, thickness: float, modulus: float, poisson: float, ends: Ends
) -> tuple[float, float]:
    r"""Relative growth of bore area and length of a tube of any thickness per pressure [1/Pa].

    .. math:: \frac{1}{A}\frac{dA}{dp} = \frac{2}{E\,(b^2 - a^2)} \cdot
              \begin{cases}
              (1+\nu)\,b^2 + (1 - 2\nu)\,a^2 & \text{closed ends, free to lengthen}\\
              (1+\nu)\,\bigl(b^2 + (1 - 2\nu)\,a^2\bigr) & \text{length fixed}\\
              (1+\nu)\,b^2 + (1 - \nu)\,a^2 & \text{no axial force}
              \end{cases}

    after Lame, with the radii ``a`` inside and ``b`` outside; for thin walls ``c D/(E s)`` with ``c
    = 1 - nu/2``, ``1 - nu^2`` and 1.  Closed ends lengthen by ``(1 - 2 nu) a^2/(E (b^2 - a^2))``,
    so that a thin closed tube holds ``(5/4 - nu) D/(E s)`` more.

    Parameters
    ----------
    diameter, thickness [m]
        Of the bore; of the wall, ``inf`` for a bore in a large body.
    modulus [Pa]
    poisson [-]

    Examples
    --------
    >>> area, length = tube_compliance(10e-3, 1e-6, 210e9, 0.3, "closed")
    >>> round((area + length) * 210e9 * 1e-6 / 10e-3, 3)  # 5/4 - nu
    0.95
    >>> round(tube_compliance(10e-3, float("inf"), 210e9, 0.3, "fixed")[0] * 210e9, 6)
    2.6
    """
    inner = 1.0 / (1.0 + 2.0 * thickness / diameter) ** 2  # (a/b)^2
    free = 1.0 - 2.0 * poisson
    share = {"closed": free, "fixed": (1.0 + poisson) * free, "sliding": 1.0 - poisson}[ends]
    # 1 - (a/b)^2 without cancellation
    ratio = thickness / diameter
    missing = 1.0 if ratio == inf else 4.0 * ratio * (1.0 + ratio) * inner
    area = 2.0 * (1.0 + poisson + share * inner) / (modulus * missing)
    return area, free * inner / (modulus * missing) if ends == "closed" else 0.0


class Wall(Section):
    """Elastic wall, by its bulk modulus or as a tube.

    ``1/K_eff = 1/K_fluid + 1/K_wall``, where ``K_wall`` is measured (hoses), or that of a tube of
    any thickness (:func:`tube_compliance`); a chamber grows in area and length, a line in area, as
    its fluid moves with it.

    Limits: linear elastic, in step with the pressure; hoses are stiffer at high and dynamic
    pressures, take the modulus measured there.
    Sources: Lame; Wylie & Streeter 1993, ch. 1.
    """

    bulk_modulus: Modulus | None = Field(
        default=None, gt=0, description="Of the wall only: pressure over relative volume growth."
    )
    diameter: Length | None = Field(default=None, gt=0, description="Inside, of a round tube.")
    thickness: Length | None = Field(default=None, gt=0, description="Of the wall of that tube.")
    modulus: Modulus | None = Field(default=None, gt=0, description="Young's modulus of the tube.")
    poisson: Ratio = Field(default=0.3, ge=0, lt=0.5, description="Poisson's ratio of the tube.")
    ends: Ends = Field(
        default="closed",
        description="closed: the pressure lengthens the tube; fixed: its length stays; sliding: no "
        "axial force.",
    )

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        tube = ("diameter", "thickness", "modulus")
        if self.bulk_modulus is not None:
            return self._refuse_with(tube, "bulk_modulus", "it describes the whole wall")
        missing = [name for name in tube if getattr(self, name) is None]
        if missing:
            raise CaseProblem(
                (),
                got=f"no {' and no '.join(missing)}",
                expected="bulk_modulus of the wall, or diameter, thickness and modulus of a tube",
                hint=f"add {missing[0]}, or give bulk_modulus instead.",
            )
        return self

    @property
    def compliance(self) -> float:
        """Relative growth of the volume of a chamber per pressure [1/Pa]."""
        return sum(self._growth())

    @property
    def area_compliance(self) -> float:
        """Relative growth of the bore area of a line per pressure [1/Pa]."""
        return self._growth()[0]

    def _growth(self) -> tuple[float, float]:
        """Of area and length; a bulk modulus counts as area."""
        if self.bulk_modulus is not None:
            return 1.0 / self.bulk_modulus, 0.0
        assert self.diameter is not None
        assert self.thickness is not None
        assert self.modulus is not None
        return tube_compliance(self.diameter, self.thickness, self.modulus, self.poisson, self.ends)
