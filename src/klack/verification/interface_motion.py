"""Two bodies and one interface without a network: the smallest loop, and an ODE solver."""

from dataclasses import dataclass
from math import pi

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import solve_banded

from klack.bodies.reduction.reduced_body import ReducedBody
from klack.contact.laws import ContactLaw, FlatLaw, HuntCrossley
from klack.contact.step_constants import NO_LAW, SEPARATED
from klack.machine.compiling.jit import njit
from klack.network.rows import FilmRow
from klack.simulation.interface_step import interface_store, solve_interface
from klack.simulation.propagator import modal_propagator

__all__ = ["InterfaceMotion", "film_by_ode", "interface_motion", "squeeze_by_volumes"]


NO_FILM = FilmRow(cubic=0.0, linear=0.0, cut_off=1e-6, suction=0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InterfaceMotion:
    """Motion of two bodies.

    Parameters
    ----------
    step [s]
    gap, law_gap (n + 1,) [m]
        Of the bodies, and behind the series compliance.
    contact_force, film_force (n,) [N]
        Means over the steps.
    contact_loss, film_loss (n,) [J]
    kinetic [J]
        Modal, of both bodies at the start.
    residual [-]
        Of the energy balance, over ``kinetic`` or the work of the force, whichever is larger.
    upper_speed [m/s]
        Of the centre of mass at the end.
    state (2 m,)
        Modal displacements and velocities at the end.
    """

    step: float
    gap: np.ndarray
    law_gap: np.ndarray
    contact_force: np.ndarray
    film_force: np.ndarray
    contact_loss: np.ndarray
    film_loss: np.ndarray
    kinetic: float
    residual: float
    upper_speed: float
    state: np.ndarray

    @property
    def peak_force(self) -> float:
        """Largest mean force of a step [N]."""
        return float(np.max(self.contact_force + self.film_force))


def interface_motion(
    upper: ReducedBody,
    lower: ReducedBody,
    law: ContactLaw | None,
    *,
    film: FilmRow | None,
    series: float = 0.0,
    gap: float,
    speed: float = 0.0,
    press: float = 0.0,
    step: float,
    steps: int,
) -> InterfaceMotion:
    """Let the port ``bottom`` of ``upper`` meet the port ``top`` of ``lower``.

    Parameters
    ----------
    upper, lower
        Undamped, so that the energy balance closes without the modes.
    series [m/N]
    gap [m]
    speed [m/s]
        Downwards.
    press [N]
        On the rigid mode of ``upper``, down.
    step [s]
    """
    flat = law.flat() if law else FlatLaw(kind=NO_LAW, parameters=np.zeros(1))
    alpha = law.dissipation if isinstance(law, HuntCrossley) else 0.0
    film = film or NO_FILM
    omega = np.concatenate([upper.omega, lower.omega])
    P = modal_propagator(omega, np.zeros(omega.size), step)
    c = np.concatenate(
        [
            upper.port_shapes[:, upper.port_names.index("bottom")],
            -lower.port_shapes[:, lower.port_names.index("top")],
        ]
    )
    rigid = np.zeros(omega.size)
    rigid[: upper.rigid_count] = upper.rigid_axial
    q, v = np.zeros(omega.size), -speed * rigid
    push = -press * rigid / upper.mass
    kinetic = 0.5 * float(v @ v)
    gaps, compressions = np.zeros(steps + 1), np.zeros(steps + 1)
    forces, losses = np.zeros((2, steps)), np.zeros((2, steps))
    gaps[0] = gap
    _run(
        q,
        v,
        np.array([P.A11, P.A12, P.A21, P.A22, P.B1, P.B2]),
        c,
        push,
        flat.kind,
        flat.parameters,
        alpha,
        np.array([film.cubic, film.linear, film.cut_off, film.suction, series, step]),
        gaps,
        compressions,
        forces,
        losses,
    )
    stored = interface_store(flat.kind, flat.parameters, 0, series, gaps[-1], compressions[-1])
    energy = 0.5 * float(v @ v + (omega * q) @ (omega * q))
    work = float(push @ q)
    missing = kinetic + work - energy - stored - float(losses.sum())
    return InterfaceMotion(
        step=step,
        gap=gaps,
        law_gap=gaps + compressions,
        contact_force=forces[0],
        film_force=forces[1],
        contact_loss=losses[0],
        film_loss=losses[1],
        kinetic=kinetic,
        residual=missing / max(kinetic, abs(work)),
        upper_speed=float(v @ rigid) / upper.mass,
        state=np.concatenate([q, v]),
    )


@njit
def _run(
    q: np.ndarray,
    v: np.ndarray,
    A: np.ndarray,
    c: np.ndarray,
    push: np.ndarray,
    kind: int,
    law: np.ndarray,
    alpha: float,
    numbers: np.ndarray,
    gaps: np.ndarray,
    compressions: np.ndarray,
    forces: np.ndarray,
    losses: np.ndarray,
) -> None:
    cubic, linear, cut_off, suction, series, h = numbers
    G = np.sum(c * c * A[4])
    g, e, force, chi, deepest, hint = gaps[0], 0.0, 0.0, 0.0, 0.0, 0
    start = g
    closed, film_before = False, 0.0
    for n in range(gaps.size - 1):
        free_q = A[0] * q + A[1] * v + A[4] * push
        v[:] = A[2] * q + A[3] * v + A[5] * push
        q[:] = free_q
        free = start + np.sum(c * q)
        if alpha > 0.0 and chi == 0.0 and free < 0.0:
            chi = alpha / max(g - free, 1e-30)
        contact, film, g, e, hint, lost_contact, lost_film = solve_interface(
            kind,
            law,
            0,
            chi,
            cubic,
            linear,
            cut_off,
            suction,
            h,
            G,
            series,
            g,
            free,
            e,
            force,
            hint,
            film_before,
        )
        film_before = film if contact > 0.0 and not closed else 0.0
        closed = contact > 0.0
        force = contact + film
        q += A[4] * c * force
        v += A[5] * c * force
        g = start + np.sum(c * q)
        if chi != 0.0:
            deepest = max(deepest, -g)
            if g > SEPARATED * deepest:
                chi = deepest = 0.0
        gaps[n + 1], compressions[n + 1] = g, e
        forces[0, n], forces[1, n] = contact, film
        losses[0, n], losses[1, n] = lost_contact, lost_film


def squeeze_by_volumes(inner: float, outer: float, cells: int) -> float:
    r"""Squeeze coefficient ``B/mu`` [m^4] of a flat ring or disc by finite volumes, second order.

    .. math:: \frac1r \frac{\mathrm d}{\mathrm dr}\Bigl(\frac{r h^3}{12 \mu}
              \frac{\mathrm dp}{\mathrm dr}\Bigr) = -V

    Parameters
    ----------
    inner, outer [m]
        An inner radius of 0 makes a disc.
    """
    edges = np.linspace(inner, outer, cells + 1)
    r, dr = 0.5 * (edges[1:] + edges[:-1]), edges[1] - edges[0]
    conductance = edges / (12.0 * dr)
    conductance[[0, -1]] *= 2.0  # p = 0 at the edges, half a cell away
    bands = np.zeros((3, cells))
    bands[0, 1:] = bands[2, :-1] = -conductance[1:-1]
    bands[1] = conductance[:-1] + conductance[1:]
    return float(np.sum(2.0 * pi * r * dr * solve_banded((1, 1), bands, r * dr)))


def film_by_ode(
    upper: ReducedBody,
    lower: ReducedBody,
    film: FilmRow,
    *,
    series: float,
    gap: float,
    speed: float,
    duration: float,
    relative: float,
) -> tuple[float, np.ndarray]:
    r"""Peak force [N] and final state of two undamped bodies that only a film and ``D`` part.

    .. math:: \dot e = -\dot g - \frac{e/D}{B/x^3 + C/x}, \qquad x = g + e + h_r

    Radau IIA of order 5 with an analytic Jacobian.  Holds while the film keeps the faces apart
    (``g + e > 0``) and does not cavitate.

    Parameters
    ----------
    upper, lower
        Ports ``bottom`` and ``top`` meet.
    series, gap, speed, duration [m/N], [m], [m/s], [s]
    relative [-]
        Tolerance.
    """
    omega = np.concatenate([upper.omega, lower.omega])
    c = np.concatenate(
        [
            upper.port_shapes[:, upper.port_names.index("bottom")],
            -lower.port_shapes[:, lower.port_names.index("top")],
        ]
    )
    m = omega.size

    def mobility(x: float) -> tuple[float, float]:
        """``V/F`` of the film and its slope over ``x``."""
        below = film.cubic + film.linear * x * x
        return x**3 / below, (3.0 * film.cubic * x**2 + film.linear * x**4) / below**2

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        q, v, e = y[:m], y[m:-1], y[-1]
        flow, _ = mobility(gap + c @ q + e + film.cut_off)
        force = e / series
        return np.concatenate([v, c * force - omega**2 * q, [-(c @ v) - flow * force]])

    def jacobian(t: float, y: np.ndarray) -> np.ndarray:
        q, e = y[:m], y[-1]
        flow, slope = mobility(gap + c @ q + e + film.cut_off)
        J = np.zeros((2 * m + 1, 2 * m + 1))
        J[:m, m:-1] = np.eye(m)
        J[m:-1, :m] = np.diag(-(omega**2))
        J[m:-1, -1] = c / series
        J[-1, :m] = -slope * e / series * c
        J[-1, m:-1] = -c
        J[-1, -1] = -slope * e / series - flow / series
        return J

    start = np.zeros(2 * m + 1)
    start[m : m + upper.rigid_count] = -speed * upper.rigid_axial
    scale = np.concatenate([np.full(m, 1e-7), np.full(m, 1e-1), [1e-8]])
    solution = solve_ivp(
        rate,
        (0.0, duration),
        start,
        method="Radau",
        jac=jacobian,
        rtol=relative,
        atol=relative * scale,
        dense_output=True,
    )
    assert solution.sol is not None  # dense_output was asked for
    fine = solution.sol(np.linspace(0.0, duration, 20001))
    return float(np.max(fine[-1]) / series), solution.y[:-1, -1]
