"""Two bodies and one interface, stepped without a network: the smallest loop around the solver."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.compiling.jit import njit
from klack.contact.laws import ContactLaw, FlatLaw, HuntCrossley
from klack.contact.step_constants import NO_LAW, SEPARATED
from klack.network.rows import FilmRow
from klack.reduction.reduced_body import ReducedBody
from klack.simulation.interface_step import interface_store, solve_interface
from klack.simulation.propagator import modal_propagator

__all__ = ["InterfaceMotion", "interface_motion"]

Vector = NDArray[np.float64]
NO_FILM = FilmRow(cubic=0.0, linear=0.0, cut_off=1e-6, suction=0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InterfaceMotion:
    """Motion of two bodies.

    Parameters
    ----------
    step : float [s]
    gap, compression : array (n + 1,) [m]
        Of the bodies and of the series compliance, at the ends of the steps.
    contact_force, film_force : array (n,) [N]
        Means over the steps.
    contact_loss, film_loss : array (n,) [J]
    stored : float [J]
        In law and series compliance at the end.
    kinetic : float [J]
        Modal energy of both bodies at the start.
    residual : float [-]
        Residual of the energy balance, over ``kinetic`` or the work of the force, whichever is
        larger.
    upper_speed : float [m/s]
        Of the centre of mass of the upper body at the end.
    state : array (2 m,)
        Modal displacements and velocities at the end.
    """

    step: float
    gap: Vector
    compression: Vector
    contact_force: Vector
    film_force: Vector
    contact_loss: Vector
    film_loss: Vector
    stored: float
    kinetic: float
    residual: float
    upper_speed: float
    state: Vector

    @property
    def law_gap(self) -> Vector:
        """Gap [m] that contact and film feel."""
        return self.gap + self.compression

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
    upper, lower : ReducedBody
        Undamped, so that the energy balance close without the modes.
    law : ContactLaw or None
    film : FilmRow or None
    series : float [m/N]
    gap : float [m]
    speed : float [m/s]
        Of ``upper``, down.
    press : float [N]
        Pushes ``upper`` down, as a body force on its rigid mode.
    step : float [s]
    steps : int
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
        compression=compressions,
        contact_force=forces[0],
        film_force=forces[1],
        contact_loss=losses[0],
        film_loss=losses[1],
        stored=float(stored),
        kinetic=kinetic,
        residual=missing / max(kinetic, abs(work)),
        upper_speed=float(v @ rigid) / upper.mass,
        state=np.concatenate([q, v]),
    )


@njit
def _run(
    q: Vector,
    v: Vector,
    A: NDArray[np.float64],
    c: Vector,
    push: Vector,
    kind: int,
    law: Vector,
    alpha: float,
    numbers: Vector,
    gaps: Vector,
    compressions: Vector,
    forces: NDArray[np.float64],
    losses: NDArray[np.float64],
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
