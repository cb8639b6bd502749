r"""A small valve twice: as a network of klack, and as plain equations for CVODE of SUNDIALS.

A needle (a rod with its exact modes) between a Hertz seat and a linear stop, both with a
compliance in series and, in the wet valve, a squeeze film; a return spring; a solenoid with leakage
and one eddy term under a constant voltage; in the wet valve a chamber below the needle that an
orifice joins to the surroundings.  The needle starts 15 um above its seat and falls onto it,
rebounds, and meets the stop.

The equations are written here from their textbook form, without any code of klack.  A film beside a
contact, both behind a compliance ``D``, makes each stop one of three differential equations for the
compression ``e = D F``, with ``g`` the gap of the bodies and ``z = g + e`` that of the faces:

=========  ===============================================  ===================================
film       ``e' = -(e/D) / C(z) - g'``, ``C = B/(z+h_r)^3``  until ``z = 0`` or ``e = -D F_s``
contact    ``e = D K d^n``, ``d = -z``                       until ``g = 0``
cavitated  ``e = -D F_s``                                    until ``C(z) g' = F_s``
=========  ===============================================  ===================================

CVODE finds these instants as roots and is started anew behind each of them.  ``rhs`` is compiled,
so CVODE pays for Python only in the call.
"""

from dataclasses import dataclass
from math import log, pi, sqrt
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from klack.hydraulics.chamber import Chamber
from klack.hydraulics.film import RingFilm
from klack.hydraulics.fluid import Fluid
from klack.hydraulics.liquid import Murnaghan
from klack.hydraulics.mixture import Vapour
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.solenoid_parts import EddyPart, PoleGap
from klack.magnetics.voltage_step import VoltageStep
from klack.mechanics.end_stop import EndStop
from klack.mechanics.flexible_body import FlexibleBody
from klack.mechanics.spring import Spring
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import Rows
from klack.simulation.bodies import rod_body
from klack.simulation.modal_step import ROW, ROW_Q, ROW_V
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network

__all__ = ["DURATION", "MODES", "Motion", "by_cvode", "by_klack", "network", "scales"]

Vector = NDArray[np.float64]

DURATION = 160e-6  # [s] ends in flight, after one impact at each stop
MODES = 5  # by default; one of them is rigid
FILM, CONTACT, CAVITATED = 0, 1, 2
SEAT, STOP = 0, 1

# needle
LENGTH, AREA, YOUNG, DENSITY, DAMPING = 0.03, 8e-6, 2.1e11, 7850.0, 0.002
SPEED = -0.4
# stops: Hertz seat, linear stop
GAPS = (15e-6, 20e-6)
HERTZ, LINEAR = 1e10, 4e7  # [N/m^1.5], [N/m]
SERIES = 1e-9
# films: seat, stop
INNER, OUTER, CUT_OFF = (0.7e-3, 0.8e-3), (0.9e-3, 1.1e-3), 0.5e-6
# spring and coil
STIFFNESS, PRELOAD = 1e4, 5.0
TURNS, RESISTANCE, VOLTAGE = 100.0, 1.5, 60.0
POLE, RESIDUAL, LEAKAGE = 2.5e-3, 40e-6, 4e-8
CONDUCTIVITY, CORE = 1.5e6, 20e-3
# fluid, chamber, orifice
AMBIENT, REFERENCE_DENSITY, BULK, BULK_SLOPE = 101_325.0, 684.0, 8e8, 10.0
VISCOSITY, VAPOUR = 4e-4, 4700.0
VOLUME, START_PRESSURE, FACE = 400e-9, 6e5, 3e-6
HOLE, DISCHARGE, CRITICAL = 0.15e-3, 0.7, 1000.0


def network(*, wet: bool = True, modes: int = MODES) -> Rows:
    """Return the rows of the valve."""
    rod = rod_body(
        "needle",
        length=LENGTH,
        area=AREA,
        young=YOUNG,
        density=DENSITY,
        elastic_modes=modes - 1,
        damping=DAMPING,
    )
    hertz = {"kind": "hertz", "radius": 1e-3, "modulus": 0.75 * HERTZ / sqrt(1e-3)}
    films = [
        RingFilm(shape="ring", inner_radius=INNER[k], outer_radius=OUTER[k], cut_off=CUT_OFF)
        for k in (SEAT, STOP)
    ]
    parts: dict[str, Component] = {
        "needle": FlexibleBody.of(rod, speed=SPEED),
        "spring": Spring(stiffness=STIFFNESS, preload=PRELOAD),
        "coil": Solenoid(
            turns=TURNS,
            resistance=RESISTANCE,
            gap=GAPS[STOP],
            residual_gap=RESIDUAL,
            poles=(PoleGap(outer_radius=POLE, fringing="none"),),
            leakage=LEAKAGE,
            eddy=(EddyPart(conductivity=CONDUCTIVITY, length=CORE, radius=POLE),),
        ),
        "driver": VoltageStep(voltage=VOLTAGE),
        "seat": EndStop(gap=GAPS[SEAT], law=hertz, series_compliance=SERIES, film=films[SEAT]),
        "stop": EndStop(
            gap=GAPS[STOP],
            law={"kind": "linear", "stiffness": LINEAR},
            series_compliance=SERIES,
            film=films[STOP],
        ),
        "below": Chamber(volume=VOLUME, pressure=START_PRESSURE),
        "face": PressureFace(direction="opening", area=FACE),
        "hole": Orifice(
            diameter=HOLE, discharge=DISCHARGE, critical_flow_number=CRITICAL, cavitation=None
        ),
    }
    connections = [
        ["needle.bottom", "seat.upper", "face.body"],
        ["needle.top", "stop.lower", "spring.end", "coil.armature"],
        ["seat.lower", "ground"],
        ["stop.upper", "ground"],
        ["coil.terminals", "driver.terminals"],
        ["below.fluid", "face.fluid", "hole.a"],
        ["hole.b", "ambient"],
    ]
    liquid = Murnaghan(
        density_at_reference=REFERENCE_DENSITY,
        bulk_modulus_at_reference=BULK,
        slope=BULK_SLOPE,
        reference_pressure=AMBIENT,
    )
    fluid = Fluid(
        name="liquid",
        temperature=293.15,
        liquid=liquid,
        base_viscosity=VISCOSITY,
        vapour=Vapour(pressure=VAPOUR, density=0.2),
    )
    valve = Network(parts, connections, fluid=fluid)
    return (valve if wet else valve.dry()).rows()


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """What both ways of computing it have in common.

    Parameters
    ----------
    q, v : array, shape (modes,) [m kg^0.5], [m kg^0.5/s]
        Modal state at the end.
    pressure : float [Pa]
    flux, leakage : float [Wb]
    compression : array, shape (2,) [m]
        Of the compliances of seat and stop.
    peaks : array, shape (2,) [N]
        Largest force on seat and stop.
    touched : array, shape (2,) [s]
        First touch of both.
    steps : int
    seconds : float
        Of the integration alone.
    """

    q: Vector
    v: Vector
    pressure: float
    flux: float
    leakage: float
    compression: Vector
    peaks: Vector
    touched: Vector
    steps: int
    seconds: float

    def distance(self, other: "Motion") -> dict[str, float]:
        """Relative distance of the mechanical state (in the energy norm), fields and peaks."""
        omega = scales(len(self.q))
        apart = np.concatenate([(self.q - other.q) * omega, self.v - other.v])
        size = np.concatenate([other.q * omega, other.v])
        return {
            "state": float(np.linalg.norm(apart) / np.linalg.norm(size)),
            "pressure": abs(self.pressure - other.pressure) / max(other.pressure, 1.0),
            "flux": abs(self.flux - other.flux) / other.flux,
            "seat peak": abs(self.peaks[SEAT] / other.peaks[SEAT] - 1.0),
            "stop peak": abs(self.peaks[STOP] / other.peaks[STOP] - 1.0),
        }


def scales(modes: int) -> Vector:
    """Angular frequencies of the needle [rad/s]; the rigid mode counts by its velocity alone."""
    return np.arange(modes) * pi * sqrt(YOUNG / DENSITY) / LENGTH


def by_klack(
    rows: Rows, *, step: float, coarse: int = 1, duration: float = DURATION
) -> tuple[Motion, NetworkResult]:
    """Run the network."""
    result = simulate_network(
        rows,
        duration=duration,
        step=step,
        coarse=coarse,
        record=1.6e-6,
        start="free",
    )
    W = result.state["bodies.fine"].reshape(-1, ROW)
    modes = rows.bodies[0].body.mode_count
    records = (result.interfaces[name] for name in ("seat", "stop"))
    forces = [(r.time, r.contact_force, r.contact_force + r.film_force) for r in records]
    channels = result.channels
    wet = "below pressure" in channels
    magnetic = result.state["elements.state"]
    return (
        Motion(
            q=W[ROW_Q, :modes].copy(),
            v=W[ROW_V, :modes].copy(),
            pressure=float(channels["below pressure"].values[-1]) if wet else 0.0,
            flux=float(channels["coil flux"].values[-1]),
            leakage=float(magnetic[1]),
            compression=result.state["interfaces.e"].copy(),
            peaks=np.array([np.max(total, initial=0.0) for _, _, total in forces]),
            touched=np.array([time[np.argmax(contact > 0.0)] for time, contact, _ in forces]),
            steps=result.fine_steps + result.coarse_steps,
            seconds=result.wall_time,
        ),
        result,
    )


@njit(cache=True)
def _indentation(K: float, linear: bool, closed: float) -> float:
    """``d`` of ``d + D K d^n = closed``: a face behind a compliance."""
    if linear:
        return closed / (1.0 + SERIES * K)
    d = closed
    for _ in range(60):
        root = sqrt(d)
        change = (d + SERIES * K * d * root - closed) / (1.0 + 1.5 * SERIES * K * root)
        d -= change
        if abs(change) < 1e-15 * closed:
            break
    return d


@njit(cache=True)
def _gaps(y: Vector, scale: float, gaps: Vector) -> None:
    """Gap and gap rate of seat and stop."""
    modes = (y.size - 5) // 2
    bottom, top, bottom_rate, top_rate = y[0], y[0], y[modes], y[modes]
    sign = 1.0
    for n in range(1, modes):
        sign = -sign
        bottom += sqrt(2.0) * y[n]
        top += sign * sqrt(2.0) * y[n]
        bottom_rate += sqrt(2.0) * y[modes + n]
        top_rate += sign * sqrt(2.0) * y[modes + n]
    gaps[0], gaps[1] = 15e-6 + scale * bottom, 20e-6 - scale * top
    gaps[2], gaps[3] = scale * bottom_rate, -scale * top_rate
    gaps[4], gaps[5] = scale * bottom, scale * top


@njit(cache=True)
def _forces(
    y: Vector, mode: Vector, gaps: Vector, B: Vector, suction: Vector, wet: bool, force: Vector
) -> None:
    """Force, relaxation rate of the compression, of seat and stop."""
    for k in range(2):
        g, e = gaps[k], y[y.size - 2 + k]
        force[2 + k] = 0.0
        if mode[k] == 1.0:
            K = 1e10 if k == 0 else 4e7
            d = _indentation(K, k == 1, max(-g, 0.0))
            force[k] = K * d if k == 1 else K * d * sqrt(d)
        elif not wet:
            force[k] = 0.0
        elif mode[k] == 2.0:
            force[k] = -suction[k]
        else:
            force[k] = e / SERIES
            x = max(g + e, 0.0) + CUT_OFF
            force[2 + k] = -force[k] * x * x * x / B[k] - gaps[2 + k]


@njit(cache=True)
def _rhs(t: float, y: Vector, out: Vector, data: Any) -> None:
    omega, mode, B, suction, scale, wet = data
    gaps, force = np.empty(6), np.empty(4)
    _gaps(y, scale, gaps)
    _forces(y, mode, gaps, B, suction, wet, force)
    modes = omega.size
    p, flux, leakage = y[2 * modes], y[2 * modes + 1], y[2 * modes + 2]
    mu0 = 4e-7 * pi * 0.99999999987
    pole = pi * POLE * POLE
    gap = 20e-6 - gaps[5] + RESIDUAL
    current = leakage / (LEAKAGE * TURNS)
    eddy = CONDUCTIVITY * CORE / (8.0 * pi)
    flux_rate = (TURNS * current - flux * gap / (mu0 * pole)) / eddy
    leakage_rate = (VOLTAGE - RESISTANCE * current) / TURNS - flux_rate
    top = flux * flux / (2.0 * mu0 * pole) - PRELOAD - STIFFNESS * gaps[5] - force[1]
    bottom = force[0]
    pressure_rate = 0.0
    if wet:
        bottom += FACE * (p - AMBIENT)
        rho = REFERENCE_DENSITY * (1.0 + BULK_SLOPE * (p - AMBIENT) / BULK) ** (1.0 / BULK_SLOPE)
        upstream = rho if p > AMBIENT else REFERENCE_DENSITY
        velocity = sqrt(2.0 * abs(p - AMBIENT) / upstream)
        number = HOLE * upstream * velocity / VISCOSITY
        hole = pi / 4.0 * HOLE * HOLE
        flow = DISCHARGE * np.tanh(2.0 * number / CRITICAL) * hole * upstream * velocity
        if p > AMBIENT:
            flow = -flow
        V = VOLUME + FACE * gaps[4]
        pressure_rate = (BULK + BULK_SLOPE * (p - AMBIENT)) / V * (flow / rho - FACE * gaps[2])
    sign = 1.0
    out[0], out[modes] = y[modes], scale * (bottom + top)
    for n in range(1, modes):
        sign = -sign
        q, v = y[n], y[modes + n]
        out[n] = v
        out[modes + n] = scale * sqrt(2.0) * (bottom + sign * top)
        out[modes + n] -= omega[n] * (omega[n] * q + 2.0 * DAMPING * v)
    out[2 * modes] = pressure_rate
    out[2 * modes + 1], out[2 * modes + 2] = flux_rate, leakage_rate
    out[2 * modes + 3], out[2 * modes + 4] = force[2], force[3]


@njit(cache=True)
def _roots(t: float, y: Vector, out: Vector, data: Any) -> None:
    """Two for each stop; each leaves its mode when one of them is crossed."""
    _, mode, B, suction, scale, wet = data
    gaps = np.empty(6)
    _gaps(y, scale, gaps)
    for k in range(2):
        g, e = gaps[k], y[y.size - 2 + k]
        first, second = 1.0, 1.0
        if mode[k] == 1.0:
            first = -g / 1e-6
        elif not wet:
            first = g / 1e-6
        elif mode[k] == 2.0:
            x = g - SERIES * suction[k] + CUT_OFF
            second = B[k] / (x * x * x) * gaps[2 + k] / suction[k] - 1.0
        else:
            first = (g + e) / 1e-6
            second = 1.0 + e / (SERIES * suction[k])
        out[2 * k], out[2 * k + 1] = first, second


def by_cvode(
    *, wet: bool = True, rtol: float, modes: int = MODES, duration: float = DURATION
) -> Motion:
    """Integrate the equations with CVODE, piece by piece between its located events."""
    from time import perf_counter

    from sksundae.cvode import CVODE

    mass = LENGTH * AREA * DENSITY
    inner, outer = np.array(INNER), np.array(OUTER)
    widths = outer**2 - inner**2
    logs = np.array([log(b / a) for a, b in zip(INNER, OUTER, strict=True)])
    B = 1.5 * pi * VISCOSITY * (outer**4 - inner**4 - widths**2 / logs)
    suction = pi * widths * (AMBIENT - VAPOUR)
    omega, mode, scale = scales(modes), np.zeros(2), 1.0 / sqrt(mass)
    data = (omega, mode, B, suction, scale, wet)
    y = np.zeros(2 * modes + 5)
    y[modes] = SPEED * sqrt(mass)
    y[2 * modes] = START_PRESSURE
    least = [*[1e-18] * modes, *[1e-13] * modes, 1e-5, 1e-17, 1e-17, 1e-20, 1e-20]
    atol = rtol / 1e-9 * np.array(least)  # at 1e-9 that share of what is usual
    options = {
        "method": "BDF" if wet else "Adams",  # films are stiff; without them Adams is twice as fast
        "rtol": rtol,
        "atol": atol,
        "max_num_steps": 1_000_000,
        "eventsfn": _terminal(_roots),
        "num_events": 4,
        "userdata": data,
    }
    _rhs(0.0, y, np.zeros_like(y), data)  # compiled before the clock starts
    t, steps, peaks, touched = 0.0, 0, np.zeros(2), np.full(2, np.nan)
    gaps, force = np.empty(6), np.empty(4)
    seconds = 0.0
    while t < duration:
        begin = perf_counter()
        solution = CVODE(_rhs, **options).solve(np.array([t, duration]), y)
        seconds += perf_counter() - begin
        if not solution.success:
            raise RuntimeError(f"CVODE at {solution.t[-1]:.3e} s: {solution.message}")
        steps += len(solution.t) - 1
        forces = np.empty((len(solution.t), 2))
        for n, row in enumerate(solution.y):
            _gaps(row, scale, gaps)
            _forces(row, mode, gaps, B, suction, wet, force)
            forces[n] = force[:2]
        peaks = np.maximum(peaks, [_highest(solution.t, forces[:, k]) for k in range(2)])
        t, y = float(solution.t[-1]), solution.y[-1].copy()
        if solution.i_events is None:
            break
        crossed = np.asarray(solution.i_events[-1])
        _gaps(y, scale, gaps)
        for k in range(2):
            if crossed[2 * k]:
                closing = mode[k] != CONTACT
                if closing and np.isnan(touched[k]):
                    touched[k] = t
                mode[k] = CONTACT if closing else FILM
                # in contact it follows the gap; behind it the faces part by next to nothing
                y[y.size - 2 + k] = 0.0 if closing else 1e-16 - gaps[k]
            if crossed[2 * k + 1]:
                resumes = mode[k] == CAVITATED
                mode[k] = FILM if resumes else CAVITATED
                y[y.size - 2 + k] = -SERIES * suction[k]
    _forces(y, mode, gaps, B, suction, wet, force)
    return Motion(
        q=y[:modes],
        v=y[modes : 2 * modes],
        pressure=float(y[2 * modes]) if wet else 0.0,
        flux=float(y[2 * modes + 1]),
        leakage=float(y[2 * modes + 2]),
        compression=SERIES * force[:2],
        peaks=peaks,
        touched=touched,
        steps=steps,
        seconds=seconds,
    )


def _highest(t: Vector, force: Vector) -> float:
    """Vertex of the parabola through the highest point and its neighbours."""
    k = int(np.argmax(force))
    if not 0 < k < len(t) - 1:
        return float(force[k])
    a, b, c = np.polyfit((t[k - 1 : k + 2] - t[k]) * 1e9, force[k - 1 : k + 2], 2)
    return float(c - 0.25 * b * b / a) if a < 0.0 else float(force[k])


def _terminal(roots: Any) -> Any:
    def events(t: float, y: Vector, out: Vector, data: Any) -> None:
        roots(t, y, out, data)

    events.terminal = [True] * 4  # type: ignore[attr-defined]
    events.direction = [-1] * 4  # type: ignore[attr-defined]
    return events
