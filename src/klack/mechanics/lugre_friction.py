"""Friction with presliding: elastic bristles between two faces (LuGre)."""

from math import exp, pi, sin
from typing import Any, ClassVar, Self

from pydantic import Field, model_validator

from klack.machine.compiling.jit import inner
from klack.mechanics.friction import require_breakaway
from klack.network.component import Component
from klack.network.port import ELEMENT, Port
from klack.network.relaxation import relaxed
from klack.network.rows import Book, Channel, Rows
from klack.network.step_function import step_function
from klack.units import DampingCoefficient, Force, Ratio, Speed, Stiffness

__all__ = ["LuGreFriction", "lugre_step"]

_LONG = 40.0  # times the largest deflection: the bristles slide from then on
_SHARE = 0.05  # of the largest deflection: way of a part of a step, elasto-plastic


@inner(error_model="numpy")
def _slip_share(z: float, elastic: float, largest: float) -> float:
    """Share of the motion that slips, Dupont et al. (2002), eq. 12; ``z`` along the motion."""
    if z <= elastic:
        return 0.0
    if z >= largest:
        return 1.0
    return 0.5 + 0.5 * sin(pi * (z - 0.5 * (largest + elastic)) / (largest - elastic))


@inner(error_model="numpy")
def _bent(z: float, elastic: float, largest: float) -> float:
    """Change of the deflection, elasto-plastic."""
    return 1.0 - _slip_share(z, elastic, largest) * z / largest


@inner(error_model="numpy")
def _elasto_plastic(z: float, way: float, elastic: float, largest: float) -> tuple[float, float]:
    """End and mean of the deflection over a way, both counted along it; Runge and Kutta."""
    if z + way <= elastic:
        return z + way, z + 0.5 * way
    left = min(way, _LONG * largest)
    total = (way - left) * largest
    wanted = left / (_SHARE * largest)
    parts = int(wanted)
    if parts < wanted:
        parts += 1
    s = left / parts
    for _ in range(parts):
        a = _bent(z, elastic, largest)
        b = _bent(z + 0.5 * s * a, elastic, largest)
        c = _bent(z + 0.5 * s * b, elastic, largest)
        d = _bent(z + s * c, elastic, largest)
        total += s * (z + s * (a + b + c) / 6.0)
        z += s * (a + 2.0 * b + 2.0 * c + d) / 6.0
    return z, total / way


@step_function
def lugre_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Bristles over a step of constant speed, exactly.

    par: stiffness, damping, its speed, Coulomb, excess, Stribeck speed, viscous, elastic share.
    The state is the mean deflection of the bristles.
    """
    h, way = inp[1], (inp[3] - inp[5]) - (inp[2] - inp[4])
    stiffness, z0 = par[0], state[0]
    speed = way / h if h > 0.0 else 0.0
    largest = par[3] + par[4] * exp(-((speed / par[5]) ** 2))
    z1, mean = z0, z0
    if way != 0.0 and par[7] > 0.0:
        sign = 1.0 if way > 0.0 else -1.0
        z1, mean = _elasto_plastic(
            sign * z0, sign * way, par[7] * largest / stiffness, largest / stiffness
        )
        z1, mean = sign * z1, sign * mean
    elif way != 0.0:
        decay, phi1, phi2 = relaxed(stiffness * abs(way) / largest)
        z1, mean = z0 * decay + way * phi1, z0 * phi1 + way * phi2
    elastic = stiffness * mean
    drag = par[6] * speed
    if par[1] > 0.0 and h > 0.0:
        damping = par[1]
        if par[2] > 0.0:
            damping *= exp(-((speed / par[2]) ** 2))
        drag += damping * ((z1 - z0) / h)
    out[0] = -(elastic + drag)
    out[1] = -out[0]
    out[2] = z1
    out[3] = 0.5 * stiffness * z1 * z1
    slipped = elastic * way - 0.5 * stiffness * (z1 + z0) * (z1 - z0)
    out[4] = max(0.0, slipped) + drag * way
    return 0


class LuGreFriction(Component):
    r"""Friction of elastic bristles: presliding, hysteresis, breakaway that depends on the rate.

    .. math::

        F = -(\sigma_0 z + \sigma_1 \dot z + \sigma_2 v), \qquad
        \dot z = v - \frac{\sigma_0 |v|}{g(v)}\, z, \qquad
        g(v) = F_c + (F_s - F_c)\, e^{-(v/v_s)^2}

    C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, IEEE Trans. Automat. Contr. 40 (1995)
    419.  At constant speed it is the Stribeck curve of ``guide-friction``; about a point of rest it
    is a spring of stiffness :math:`\sigma_0`.  In a step of constant speed ``z`` is integrated
    exactly, so no step is too long for it.

    With ``elastic_share`` above zero the bristles hold without any slip up to that share of their
    largest deflection: the elasto-plastic model of P. Dupont, V. Hayward, B. Armstrong, F. Altpeter
    (IEEE Trans. Automat. Contr. 47 (2002) 787).  Under a vibrating force below breakaway LuGre
    drifts, this does not.

    Take it in place of ``guide-friction``, which sticks rigidly and needs no stiffness, where
    displacements of less than :math:`F_s/\sigma_0` matter.

    Limits: :math:`\sigma_1` can release energy at speeds above :math:`4 g/\sigma_1`; its factor
    :math:`e^{-(v/v_d)^2}` (``damping_speed``, Olsson 1996) prevents that.
    """

    type: ClassVar[str] = "lugre-friction"
    ports: ClassVar = {
        "body": ELEMENT,
        "guide": Port("mechanical", ELEMENT.role, optional=True),
    }

    coulomb: Force = Field(gt=0, description="Sliding friction F_c at high speed.")
    breakaway: Force | None = Field(
        default=None, gt=0, description="Largest friction F_s at low speed; default F_c."
    )
    stribeck_speed: Speed = Field(
        default=0.01, gt=0, description="Speed v_s at which the excess of F_s has decayed to 1/e."
    )
    viscous: DampingCoefficient = Field(default=0.0, ge=0, description="Viscous part sigma_2.")
    bristle_stiffness: Stiffness = Field(
        gt=0,
        description="Stiffness sigma_0 about a point of rest: F_s over the presliding distance.",
    )
    bristle_damping: DampingCoefficient = Field(
        default=0.0, ge=0, description="Damping sigma_1 of the bristles."
    )
    damping_speed: Speed | None = Field(
        default=None, gt=0, description="Speed v_d at which sigma_1 has decayed to 1/e."
    )
    elastic_share: Ratio = Field(
        default=0.0,
        ge=0,
        lt=1,
        description="Share of the largest deflection up to which nothing slips; 0 is LuGre.",
    )

    @model_validator(mode="after")
    def _excess(self) -> Self:
        require_breakaway(self.coulomb, self.breakaway)
        return self

    def add_rows(self, rows: Rows) -> None:
        """Add one element; without ``guide`` the guide is the ground."""
        breakaway = self.coulomb if self.breakaway is None else self.breakaway
        rows.element(
            lugre_step,
            ports=(rows.port("body"), rows.port("guide")),
            parameters=(
                self.bristle_stiffness,
                self.bristle_damping,
                self.damping_speed or 0.0,
                self.coulomb,
                breakaway - self.coulomb,
                self.stribeck_speed,
                self.viscous,
                self.elastic_share,
            ),
            state=(0.0,),
            books=(Book("energy", "store"), Book("friction", "loss")),
            channels=(Channel("bristle deflection", "m", 0),),
        )
