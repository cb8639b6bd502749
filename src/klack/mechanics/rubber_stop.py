"""Rubber buffer: nonlinear spring with Maxwell elements, touched across a gap."""

from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from klack.input.problem import refuse_key_if
from klack.input.section import Number, Section
from klack.machine.compiling.jit import inner
from klack.mechanics.nonlinear_spring import (
    HIGHEST_POWER,
    curve_mean,
    curve_numbers,
    curve_slope,
    curve_value,
    curve_work,
)
from klack.network.component import Component
from klack.network.port import ELEMENT, Port
from klack.network.relaxation import relaxed
from klack.network.rows import Book, Channel, Rows
from klack.network.step_function import step_function
from klack.units import Length, Stiffness, Time

__all__ = ["MaxwellElement", "RubberStop"]

_MOST_NEWTON = 40
_FOUND = 1e-15  # of the indentation


@inner(error_model="numpy")
def _store(par: Any, curve: int, forces: Any, first: int, s: float) -> float:
    """Energy of the rubber [J] at an indentation and forces of its Maxwell elements."""
    energy = curve_work(par, curve, s)
    for i in range(int(par[1])):
        f = forces[first + i]
        energy += 0.5 * f * f / par[2 + 2 * i]
    return energy


@inner(error_model="numpy")
def _free_surface(par: Any, curve: int, state: Any, s0: float, h: float) -> float:
    """Indentation at which nothing presses at the end of a step [m]."""
    s, pull, slope = s0, 0.0, 0.0
    for i in range(int(par[1])):
        decay, phi1, _ = relaxed(h / par[3 + 2 * i])
        pull += state[2 + i] * decay
        slope += par[2 + 2 * i] * phi1
    for _ in range(_MOST_NEWTON):
        left = curve_value(par, curve, s) + pull + slope * (s - s0)
        move = left / (curve_slope(par, curve, s) + slope)
        s -= move
        if abs(move) <= _FOUND * abs(s):
            break
    return s


@step_function
def rubber_stop_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Buffer between two ports; par: gap, elements n, stiffness and time of each, curve.

    State: indentation of the surface, 1 in contact, forces of the Maxwell elements.
    """
    h, n = inp[1], int(par[1])
    d0, d1 = inp[4] - inp[2] - par[0], inp[5] - inp[3] - par[0]
    curve, books = 2 + 2 * n, 4 + n
    touched = state[1] != 0.0
    s0 = d0 if touched else state[0]
    before = _store(par, curve, state, 2, s0)
    if h <= 0.0:
        out[0] = out[1] = 0.0
        for i in range(2 + n):
            out[2 + i] = state[i]
        out[books], out[books + 1] = before, 0.0
        return 0
    free = _free_surface(par, curve, state, s0, h)
    touches = d1 > free
    s1 = d1 if touches else free
    mean, loss = curve_mean(par, curve, s0, s1), 0.0
    for i in range(n):
        k, f0 = par[2 + 2 * i], state[2 + i]
        decay, phi1, phi2 = relaxed(h / par[3 + 2 * i])
        f1 = f0 * decay + k * (s1 - s0) * phi1
        f = f0 * phi1 + k * (s1 - s0) * phi2
        loss += max(0.0, f * (s1 - s0) - 0.5 * (f1 + f0) * (f1 - f0) / k)
        mean += f
        out[4 + i] = f1
    force = 0.0
    after = _store(par, curve, out, 4, s1)
    if touches and touched:
        force = mean
    elif touches and d1 > d0:
        # touched on the way: the part of the step in contact
        force = max(0.0, mean * (s1 - s0)) / (d1 - d0)
        loss = force * (d1 - d0) + before - after
    else:
        loss = before - after
    out[0], out[1] = force, -force
    out[2], out[3] = s1, 1.0 if touches else 0.0
    out[books], out[books + 1] = after, loss
    return 0


class MaxwellElement(Section):
    """Spring and dashpot in series: stiff when fast, without force when slow."""

    stiffness: Stiffness = Field(gt=0, description="Stiffness k_i at high speed.")
    time: Time = Field(gt=0, description="Relaxation time tau_i; loss peaks at 1/(2 pi tau_i).")


class RubberStop(Component):
    r"""Rubber buffer whose stiffness and loss depend on the frequency.

    .. math::

        F = f(s) + \sum_i f_i, \qquad \dot f_i = k_i \dot s - f_i/\tau_i, \qquad
        k^*(\omega) = f'(s) + \sum_i k_i \frac{\mathrm i \omega \tau_i}{1 + \mathrm i \omega \tau_i}

    over the indentation :math:`s`, with :math:`f(s) = k s\,[1 + \sum_i a_i (s/s_r)^i]`: a nonlinear
    spring with Maxwell elements beside it (generalised Maxwell or Wiechert model; J. D. Ferry,
    Viscoelastic Properties of Polymers, 1980, ch. 3).  Elements a decade apart in time
    give a nearly constant loss over the band that they span.

    It touches when ``gap`` is closed and never pulls: a surface that recovers more slowly than the
    body leaves stays behind, free of force, and is touched where it then is.  The elements are
    integrated exactly over a step of constant speed.

    Limits: no mass, no sticking, no film.  Touches are no impacts of the results, and the check of
    strokes before a run does not take it for an end of the stroke.
    """

    type: ClassVar[str] = "rubber-stop"
    ports: ClassVar = {
        "upper": ELEMENT,
        "lower": Port("mechanical", ELEMENT.role, optional=True),
    }

    gap: Length = Field(description="Gap at the start; negative for a compressed buffer.")
    stiffness: Stiffness = Field(gt=0, description="Stiffness k of slow compression.")
    higher: tuple[Number, ...] = Field(
        default=(),
        max_length=HIGHEST_POWER - 1,
        description="Terms a1, a2, ... of its stiffening, not negative.",
    )
    reference: Length | None = Field(
        default=None, gt=0, description="Indentation s_r at which a term has its value."
    )
    maxwell: tuple[MaxwellElement, ...] = Field(
        default=(), max_length=20, description="Maxwell elements in parallel with the spring."
    )

    @model_validator(mode="after")
    def _terms(self) -> Self:
        wrong = any(a < 0.0 for a in self.higher)
        refuse_key_if(
            wrong or bool(self.higher) != (self.reference is not None),
            ("higher",),
            got="a negative term"
            if wrong
            else f"{len(self.higher)} terms"
            + ("" if self.reference is None else " and a reference"),
            expected="terms of at least 0 together with 'reference', or neither",
            hint="rubber stiffens; with reference: 1 mm, higher: [0.2] adds 20 % there.",
        )
        return self

    def modulus(self, frequency: ArrayLike) -> NDArray[np.complex128]:
        """Complex stiffness of small motions about no indentation [N/m] at frequencies [Hz]."""
        omega = 2.0 * np.pi * np.asarray(frequency, dtype=float)
        total = np.full(omega.shape, self.stiffness, dtype=complex)
        for part in self.maxwell:
            turn = 1j * omega * part.time
            total += part.stiffness * turn / (1.0 + turn)
        return total

    def add_rows(self, rows: Rows) -> None:
        """Add one element; without ``lower`` it stands on the ground."""
        n, scale = len(self.maxwell), self.reference or 1.0
        terms = [1.0, *self.higher]
        powers = [self.stiffness * a / scale**i for i, a in enumerate(terms)]
        straight = [0.0, self.stiffness] + [0.0] * (len(powers) - 1)
        curve = curve_numbers(np.zeros(1), np.array([straight, [0.0, *powers]]))

        def at_rest(displacement: NDArray[np.float64]) -> NDArray[np.float64]:
            state = np.zeros(2 + n)
            deep = float(displacement[1] - displacement[0]) - self.gap
            if deep > 0.0:
                state[:2] = deep, 1.0
            return state

        rows.element(
            rubber_stop_step,
            ports=(rows.port("upper"), rows.port("lower")),
            parameters=(
                self.gap,
                n,
                *(x for part in self.maxwell for x in (part.stiffness, part.time)),
                *curve,
            ),
            state=at_rest(np.zeros(2)),
            at_rest=at_rest,
            books=(Book("energy", "store"), Book("loss", "loss")),
            channels=(Channel("indentation", "m", 0),),
        )
