r"""Drag of a body that moves unsteadily in a liquid at rest: steady drag, memory, added mass."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import inf, log, pi, sqrt
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from scipy.optimize import nnls

from klack.errors import refuse_if
from klack.hydraulics.network_fluid import fixed_viscosity
from klack.input.problem import refuse_key_if
from klack.network.component import Component
from klack.network.port import ELEMENT, Port
from klack.network.relaxation import relaxed
from klack.network.rows import Book, Channel, LimitRow, Rows
from klack.network.step_function import step_function
from klack.units import Area, Length, Mass, Speed

__all__ = ["SHORTEST_MEMORY", "UnsteadyDrag", "basset", "couette", "decaying_sum", "mei_adrian"]

Curve = Callable[[NDArray[np.float64]], NDArray[np.float64]]

SHORTEST_MEMORY, LONGEST_MEMORY = 1e-8, 10.0
"""Times [s] between which the memory is that of its kernel."""

_NEWTON = 800.0  # Reynolds number up to which the law of Schiller and Naumann holds


def basset(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Stokes layer that grows into a liquid without end, ``1/sqrt(pi x)``; ``x = nu t / a^2``."""
    return np.asarray(1.0 / np.sqrt(pi * x))


def mei_adrian(x: NDArray[np.float64]) -> NDArray[np.float64]:
    r"""Basset's kernel that the flow past the sphere ends, :math:`x^{-1/2} (1 + x^{3/4})^{-2}`.

    Of the time over :math:`t_c`; see :class:`UnsteadyDrag`.
    """
    return np.asarray(1.0 / (np.sqrt(x) * (1.0 + x**0.75) ** 2))


def couette(x: NDArray[np.float64]) -> NDArray[np.float64]:
    r"""Layer between two walls, :math:`2\sum_n e^{-n^2\pi^2 x}`; ``x = nu t / h^2``."""
    x = np.asarray(x)
    terms = np.arange(1.0, 30.0)
    late = 2.0 * np.exp(-np.outer(terms**2 * pi**2, x)).sum(axis=0)
    early = basset(x) * (1.0 + 2.0 * np.exp(-1.0 / x)) - 1.0  # theta function, transformed
    return np.where(x < 0.1, early, late)


def decaying_sum(
    kernel: Curve,
    first: float,
    last: float,
    scale: Curve | None = None,
    slowest: float | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    r"""Weights and times of :math:`\sum_i w_i e^{-x/\tau_i}` for a kernel, all of them positive.

    Kernels that are completely monotone have such a sum (Bernstein).  Its terms are masses that
    dampers drag along, so the memory never gives energy.  The error is below 0.3 % of ``scale``,
    by default of the kernel, from ``first`` to ``last``.  ``slowest`` is the longest time, if it
    is known.
    """
    count = int(log(last / first)) + 6
    times = np.geomspace(first / 4.0, slowest or 4.0 * last, count)
    x = np.geomspace(first, last, 20 * count)
    size = (scale or kernel)(x)
    columns = np.exp(-x[:, None] / times) / size[:, None]
    weights, _ = nnls(columns, kernel(x) / size, maxiter=100 * count)
    kept = weights > 0.0
    return weights[kept], times[kept]


@step_function
def unsteady_drag_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Drag at the mean speed of the step, and masses on dampers, exactly for it.

    par: steady drag per speed, Reynolds number per speed, layers n, then damping and time of each.
    State: speed of each layer, then the Reynolds number.
    """
    h, way = inp[1], (inp[3] - inp[5]) - (inp[2] - inp[4])
    n = int(par[2])
    speed = way / h if h > 0.0 else 0.0
    reynolds = par[1] * abs(speed)
    force = par[0] * speed
    if reynolds > 0.0:
        force *= 1.0 + 0.15 * reynolds**0.687
    store, loss = 0.0, force * way
    for i in range(n):
        damping, time, after = par[3 + 2 * i], par[4 + 2 * i], state[i]
        if h > 0.0:
            decay, phi1, _ = relaxed(h / time)
            behind = speed - after
            force += damping * phi1 * behind
            # int (behind e^(-t/time))^2 dt
            loss += 0.5 * damping * h * phi1 * (1.0 + decay) * behind * behind
            after = speed - decay * behind
        store += 0.5 * damping * time * after * after
        out[2 + i] = after
    out[0], out[1] = -force, force
    out[2 + n] = reynolds
    out[3 + n] = store
    out[4 + n] = loss
    return 0


class UnsteadyDrag(Component):
    r"""Force of a liquid at rest on a body that moves through it, with memory and added mass.

    .. math::

        F = -D(v) - \int_{-\infty}^t K(t - s)\,\dot v(s)\,ds - m_a \dot v

    of a sphere of radius ``a`` far from walls (Basset 1888; Schiller & Naumann 1933), with the
    Reynolds number :math:`\mathrm{Re} = 2 a |v|/\nu`,

    .. math::

        D = 6\pi\mu a\,v\,(1 + 0.15\,\mathrm{Re}^{0.687}), \qquad
        K = \frac{6\pi\mu a^2}{\sqrt{\pi\nu t}}, \qquad m_a = \tfrac23 \pi a^3 \varrho,

    and of a liquid layer of height ``h`` and area ``A`` along a wall that moves in its plane, the
    start of Couette's flow,

    .. math::

        D = \frac{\mu A}{h}\,v, \qquad
        K = \frac{2\mu A}{h} \sum_{n=1}^\infty e^{-n^2\pi^2\nu t/h^2}, \qquad m_a = 0 .

    With ``typical_speed`` U the flow past the sphere ends the memory (Mei & Adrian, J. Fluid Mech.
    237 (1992) 323), at a constant speed:

    .. math::

        K = 6\pi\mu a \Bigl[\Bigl(\frac{\pi\nu t}{a^2}\Bigr)^{1/4}
            + \Bigl(\frac{\pi U^3 t^2}{2 a \nu f^3}\Bigr)^{1/2}\Bigr]^{-2}, \qquad
        f = 0.75 + 0.105\,\frac{2 a U}{\nu}

    The kernel is a sum of decaying exponentials with positive weights
    (:func:`decaying_sum`), right to 0.3 % from 10 ns to 10 s: layers of liquid, masses that
    dampers drag along.  Their kinetic energy is stored, the rest of the work is heat, never
    negative on any way.  Steps of constant speed are exact.

    Before the start the body has moved at its starting speed long since.  Added mass
    belongs to the inertia of the body as a whole; ``gravity`` does not weigh it, nor does it know
    of buoyancy: give it ``g (1 - rho_f/rho_b)``.

    Limits: the liquid is at rest elsewhere, the law of the drag holds to Re = 800, added mass grows
    by up to 60 % towards a wall (a film at an end stop does not contain that), and after a reversal
    the body meets its own wake: measured rebounds lie between the two kernels
    (:doc:`/reference/measured`).  In three dimensions it acts along the axis, without added mass.
    """

    type: ClassVar[str] = "unsteady-drag"
    ports: ClassVar[Mapping[str, Port]] = {
        "body": ELEMENT,
        "around": Port("mechanical", ELEMENT.role, optional=True),
    }

    shape: Literal["sphere", "layer"] = Field(description="Moving surface: sphere, or layer.")
    radius: Length | None = Field(default=None, gt=0, description="Of the sphere, a.")
    area: Area | None = Field(default=None, gt=0, description="Of the layer, A.")
    height: Length | None = Field(default=None, gt=0, description="Of the layer, h.")
    steady: bool = Field(
        default=True,
        description="Whether D acts; false together with an annulus, which includes it.",
    )
    memory: bool = Field(default=True, description="Whether the liquid remembers: K.")
    typical_speed: Speed | None = Field(
        default=None, gt=0, description="Of the sphere, U, for the kernel of Mei and Adrian."
    )
    added_mass: Mass | None = Field(
        default=None, ge=0, description="m_a; default: that of the shape."
    )

    @model_validator(mode="after")
    def _of_one_shape(self) -> Self:
        needs = {"sphere": ("radius",), "layer": ("area", "height")}[self.shape]
        for key in ("radius", "area", "height", "typical_speed"):
            given = getattr(self, key) is not None
            refuse_key_if(
                given and key not in needs and (self.shape == "layer" or key != "typical_speed"),
                (key,),
                got=f"a value, for shape: {self.shape}",
                expected=f"the keys of that shape: {', '.join(needs)}",
                hint="leave it out, or change the shape.",
            )
            refuse_key_if(
                not given and key in needs,
                (key,),
                got="nothing",
                expected=f"a value, for shape: {self.shape}",
                hint="write it, with its unit.",
            )
        return self

    def dry(self) -> None:
        """Nothing: it is the liquid."""

    def added(self, density: float) -> float:
        """Added mass [kg] in a liquid of a density [kg/m^3]."""
        if self.added_mass is not None:
            return self.added_mass
        return 2.0 / 3.0 * pi * density * self.radius**3 if self.radius else 0.0

    def layers(
        self, density: float, viscosity: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Damping [N s/m] and time [s] of each layer; none without memory."""
        nu = viscosity / density
        if not self.memory:
            return np.empty(0), np.empty(0)
        if self.shape == "layer":
            assert self.area is not None and self.height is not None  # noqa: PT018
            unit = self.height**2 / nu
            first = min(SHORTEST_MEMORY / unit, 1e-2)
            weights, times = decaying_sum(couette, first, 1.0, basset, 1.0 / pi**2)
            return weights * viscosity * self.area / self.height, times * unit
        assert self.radius is not None
        a, unit = self.radius, self.radius**2 / nu
        size, kernel, last = 6.0 * pi * viscosity * a, basset, LONGEST_MEMORY
        if self.typical_speed is not None:
            f = 0.75 + 0.105 * 2.0 * a * self.typical_speed / nu
            flow = pi * self.typical_speed**3 / (2.0 * a * nu * f**3)
            unit = ((pi * nu / a**2) ** 0.25 / sqrt(flow)) ** (4.0 / 3.0)
            size *= sqrt(a**2 / (pi * nu * unit))
            kernel, last = mei_adrian, min(100.0 * max(unit, SHORTEST_MEMORY), LONGEST_MEMORY)
        weights, times = decaying_sum(kernel, SHORTEST_MEMORY / unit, last / unit)
        return weights * size, times * unit

    def add_rows(self, rows: Rows) -> None:
        """Add one element, and the added mass to the body once all components are there."""
        fluid, viscosity = fixed_viscosity(rows)
        density = float(fluid.density(rows.ambient.pressure))
        damping, time = self.layers(density, viscosity)
        name, port, n = rows.component, rows.port("body"), len(damping)
        if self.shape == "sphere":
            radius = self.radius or 0.0
            steady, reynolds = 6.0 * pi * viscosity * radius, 2.0 * radius * density / viscosity
        else:
            steady, reynolds = viscosity * (self.area or 0.0) / (self.height or inf), 0.0
        if not self.steady:
            steady, reynolds = 0.0, 0.0
        past = _starting_speed(rows, "body") - _starting_speed(rows, "around")
        table = np.column_stack((damping, time)).ravel()
        rows.element(
            unsteady_drag_step,
            ports=(port, rows.port("around")),
            parameters=(steady, reynolds, n, *table),
            state=(*np.full(n, past), 0.0),
            books=(Book("energy", "store"), Book("drag", "loss")),
            channels=(Channel("Reynolds number", "-", n, derived=True),),
            state_names={i: (f"speed of layer {i + 1}", "m/s") for i in range(n)},
        )
        if self.shape == "sphere":
            rows.limits.append(
                LimitRow(
                    component=name,
                    quantity="Reynolds number",
                    unit="-",
                    valid=(0.0, _NEWTON),
                    law="the drag of a sphere",
                    source="Schiller and Naumann 1933",
                    effect=lambda value: "The drag is higher there than computed.",
                    advice="check radius and speed; at such speeds inertia dominates.",
                    channel=f"{name} Reynolds number",
                )
            )
        added = self.added(density)
        if added > 0.0:
            rows.closing[f"{name} added mass"] = lambda all_rows: _load(all_rows, name, port, added)


def _starting_speed(rows: Rows, port: str) -> float:
    """Speed [m/s] of the body at a port at the start; 0 of the ground."""
    return sum(float(getattr(body, "speed", 0.0)) for body in rows.partner(port))


def _load(rows: Rows, component: str, port: int, added: float) -> None:
    """Scale the rigid mode of the body at a port: it moves with more mass there."""
    for k, row in enumerate(rows.bodies):
        if port not in row.ports or row.course is not None:
            continue
        body = row.body
        refuse_if(
            body.rigid_count != 1,
            f"component '{component}': added mass",
            got=f"a body with {body.rigid_count} rigid motions",
            expected="one rigid motion, along the axis",
            hint="write added_mass: 0 g, and add its mass to that of the body.",
        )
        heavier = body.mass + added * row.face_ratio(port) ** 2
        scale = sqrt(body.mass / heavier)
        first = np.r_[scale, np.ones(body.mode_count - 1)][:, None]
        recovery = body.recovery
        if recovery is not None:
            recovery = replace(recovery, shapes=recovery.shapes * first.T)
        rows.bodies[k] = replace(
            row,
            body=replace(
                body,
                mass=heavier,
                port_shapes=body.port_shapes * first,
                observer_shapes=body.observer_shapes * first,
                rigid_axial=body.rigid_axial / scale,
                recovery=recovery,
            ),
        )
