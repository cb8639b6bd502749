"""The time loop of a network: a whole valve, then one law after the other."""

from collections.abc import Mapping
from math import exp, pi, sqrt
from typing import ClassVar
from warnings import catch_warnings, filterwarnings, simplefilter

import numpy as np

from klack.contact.laws import LinearLaw
from klack.errors import AccuracyWarning
from klack.hydraulics.film import ConeFilm, RingFilm
from klack.hydraulics.flow_source import FlowSource, FlowStep
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.fluid_table import fluid_at, fluid_table
from klack.magnetics.driver import Driver
from klack.magnetics.iron import VACUUM_PERMEABILITY
from klack.magnetics.peak_hold import PeakHold
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.solenoid_parts import PoleGap
from klack.mechanics.flexible_body import FlexibleBody
from klack.mechanics.stop_law import LinearStopLaw
from klack.network.checks import LooseBodyWarning
from klack.network.component import Component
from klack.network.network import Network
from klack.network.port import ELEMENT, Port
from klack.network.rows import Ambient, FilmRow, Rows
from klack.simulation.bodies import fixed_body, rigid_mass_body, rod_body
from klack.simulation.impact import simulate_impact
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.units import Compliance, Length
from klack.verification.benches import component
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.interface_motion import film_by_ode
from klack.verification.one_dimension import one_contact, steel_rod

__all__ = ["LIFT", "PRELOAD", "checks", "peak_and_hold", "whole_valve"]


LIFT = 100e-6
"""Gap of the opening stop [m]."""

PRELOAD = 12.0
"""Of the return spring [N]."""

_STEEL = {"young": 2.1e11, "density": 7850.0}
_SUPPLY = 6.013e5  # [Pa]
_SEALING = 1.768e-3  # [m]


def peak_and_hold(*, start: float = 0.0, end: float = 2.5e-3) -> PeakHold:
    """Driver of direct injection: 65 V up to 10 A, then 3.5 A, and back into the capacitor."""
    return PeakHold(
        start=start,
        end=end,
        boost_voltage=65.0,
        peak_current=10.0,
        supply_voltage=14.0,
        hold_current=3.5,
        hold_band=0.8,
        decay=65.0,
    )


def whole_valve(
    *,
    modes: tuple[int, int, int] = (20, 40, 20),
    damping: float = 0.01,
    driver: Driver | None = None,
    gas_fraction: float = 1e-4,
) -> Network:
    """Normally closed valve at 5 bar in n-heptane: about 1 ms to open, 0.3 ms to close.

    Needle (3 g), housing and pole are rods with exact modes. Line, inlet chamber, ball seat, sac,
    nozzle; solenoid with two poles, iron, leakage and one eddy term. End stops have a contact, a
    film and a compliance in series.

    Parameters
    ----------
    modes
        Of needle (one of them rigid), housing and pole.
    damping [-]
        Elastic.
    driver
        Default: :func:`peak_and_hold`.
    gas_fraction [-]
    """
    parts: dict[str, Component] = {
        "needle": _rod("needle", 0.04, 3e-3 / (0.04 * 7850.0), modes[0] - 1, damping, free=True),
        "housing": _rod("housing", 0.1, pi / 4 * 10e-3**2, modes[1], damping),
        "pole": _rod("pole", 0.04, pi / 4 * 7.6e-3**2, modes[2], damping),
        "spring": component("spring", stiffness=1e4, preload=PRELOAD),
        "driver": driver or peak_and_hold(),
        **_stops(),
        **_solenoid(),
        "supply": component("pressure-source", pressure=_SUPPLY),
        "feed": component("line", length=0.06, diameter=2.5e-3, pressure=_SUPPLY),
        "inlet": component("chamber", volume=600e-9, pressure=_SUPPLY),
        "sac": component("chamber", volume=2e-9),
        "restriction": component(
            "seat", shape="ball", diameter=_SEALING, ball_diameter=2.5e-3, bore_diameter=0.9e-3
        ),
        "nozzle": component("orifice", diameter=0.4e-3),
        "top_face": component("pressure-face", direction="closing", outer_diameter=_SEALING),
        "tip_face": component("pressure-face", direction="opening", outer_diameter=_SEALING),
    }
    return Network(
        parts,
        [
            ["needle.bottom", "seat.upper", "restriction.needle", "tip_face.body"],
            ["needle.top", "opening.lower", "spring.end", "coil.armature", "top_face.body"],
            ["housing.top", "seat.lower", "restriction.body"],
            ["pole.top", "opening.upper", "coil.base"],
            ["driver.terminals", "coil.terminals"],
            ["supply.fluid", "feed.a"],
            ["feed.b", "inlet.fluid", "restriction.a", "top_face.fluid"],
            ["restriction.b", "sac.fluid", "tip_face.fluid", "nozzle.a"],
            ["nozzle.b", "ambient"],
        ],
        fluid=library_fluid("n-heptane").at(293.15, gas_fraction=gas_fraction),
    )


def _rod(
    name: str, length: float, area: float, modes: int, damping: float, *, free: bool = False
) -> FlexibleBody:
    rod = rod_body(
        name,
        length=length,
        area=area,
        elastic_modes=modes,
        support="free" if free else "bottom",
        damping=damping,
        **_STEEL,
    )
    return FlexibleBody.of(rod, ("bottom", "top") if free else ("top",))


def _stops() -> dict[str, Component]:
    law = LinearStopLaw(kind="linear", stiffness=5e8)
    land = ConeFilm(
        shape="cone",
        mean_radius=0.5 * _SEALING,
        width=0.1e-3,
        half_angle=pi / 4,
        roughness=0.2e-6,
        pressure=_SUPPLY,
    )
    ring = RingFilm(
        shape="ring", inner_radius=1.35e-3, outer_radius=1.95e-3, cut_off=1.2e-6, pressure=_SUPPLY
    )
    return {
        "seat": component("end-stop", gap=0.0, law=law, series_compliance=1e-9, film=land),
        "opening": component("end-stop", gap=LIFT, law=law, series_compliance=1e-9, film=ring),
    }


def _solenoid() -> dict[str, Component]:
    iron = [(20e-3, 33e-6), (2.5e-3, 70e-6), (40e-3, 60e-6)]
    coil = Solenoid.model_validate(
        {
            "turns": 60.0,
            "resistance": 0.6,
            "gap": LIFT,
            "residual_gap": 50e-6,
            "poles": [
                {"inner_radius": 1.95e-3, "outer_radius": 3.8e-3, "fringing": "none"},
                {"inner_radius": 4.8e-3, "outer_radius": 6e-3, "fringing": "none"},
            ],
            "iron": [{"material": "X6Cr17", "length": x, "area": A} for x, A in iron],
            "leakage_share": 0.1,
            "eddy": [{"conductivity": 1.5e6, "length": 20e-3, "radius": 3.8e-3, "slots": 0.15}],
        }
    )
    return {"coil": coil}


IDENTITY = "energy identity of every step: work, stores, losses of all domains"
STEP = 20e-9
RECORD = 1.28e-6
NEVER = 1e9  # [N] suction that is never reached


def checks() -> list[Check]:
    """A whole valve, then single laws in the smallest network that shows each."""
    valve = whole_valve(damping=0.0, driver=peak_and_hold(end=0.6e-3))
    wet, dry = (_run(network, 1.6e-3, coarse=16) for network in (valve, valve.dry()))
    return [
        _ledger("wet", wet, 5e-13),
        _ledger("dry", dry, 1.5e-13),
        _sac(valve, wet),
        _momentum(dry),
        *_repeats(valve, wet),
        *_steps(),
        _rest(),
        _reciprocity(),
        _kernel(),
        *_half_sine(),
        *_films(),
        *_surge(),
        *_coil(),
    ]


def _run(
    network: Network,
    duration: float,
    *,
    coarse: int = 1,
    step: float = STEP,
    record: float = RECORD,
    free: bool = False,
    state: Mapping[str, np.ndarray] | None = None,
) -> NetworkResult:
    with catch_warnings():  # some bodies fly freely, on purpose
        simplefilter("ignore", LooseBodyWarning)
        rows = network.rows()
    with catch_warnings():  # peaks are too low in steps that are coarse on purpose
        filterwarnings("ignore", "the peak force of the first impact", AccuracyWarning)
        return simulate_network(
            rows,
            duration=duration,
            step=step,
            coarse=coarse,
            record=record,
            start="free" if free else "rest",
            state=state,
        )


def _values(result: NetworkResult, name: str) -> np.ndarray:
    return result.channels[name].values


def _ledger(name: str, result: NetworkResult, tolerance: float) -> Check:
    return check(
        f"valve of 80 undamped modes opens and closes, {name}, energy residual [-]",
        0.0,
        result.books.relative_residual,
        tolerance,
        IDENTITY,
    )


def _sac(valve: Network, result: NetworkResult) -> Check:
    assert valve.fluid is not None
    table = fluid_table(valve.fluid, valve.ambient.pressure)
    rho = np.array([fluid_at(table, p, 0)[0] for p in _values(result, "sac pressure")])
    area = pi / 4 * 1.768e-3**2
    mass = rho * (2e-9 + area * _values(result, "needle.bottom displacement"))
    flow = _values(result, "restriction mass flow") - _values(result, "nozzle mass flow")
    moved = float(flow[1:].sum()) * (result.time[1] - result.time[0])
    return check(
        "fluid that the sac gained against both flows, of its mass [-]",
        0.0,
        float((mass[-1] - mass[0] - moved) / mass[0]),
        5e-8,
        "conservation of mass",
        reason="the mass is exact; the pressure keeps the square of its last Newton step",
    )


def _momentum(result: NetworkResult) -> Check:
    forces = (
        _values(result, "spring.end force")
        + _values(result, "coil.armature force")
        + _values(result, "seat contact force")
        - _values(result, "opening contact force")
    )
    velocity = _values(result, "needle velocity")
    return check(
        "momentum of the needle against the impulse of all forces [N s]",
        3e-3 * float(velocity[-1] - velocity[0]),
        float(forces[1:].sum()) * (result.time[1] - result.time[0]),
        1e-6,
        "Newton's second law; dry, two impacts",
        reason="the force that repays energy is in no channel",
    )


def _repeats(valve: Network, first: NetworkResult) -> list[Check]:
    records = 147  # in the first impact
    head = _run(valve, records * RECORD, coarse=16)
    return [
        check(
            "the same run twice, numbers that differ",
            0.0,
            _different(_run(valve, 1.6e-3, coarse=16), first, 0),
            0.0,
            "determinism",
        ),
        check(
            "run stored in an impact and continued, numbers that differ",
            0.0,
            _different(
                _run(valve, first.time[-1] - head.time[-1], coarse=16, state=head.state),
                first,
                records,
            ),
            0.0,
            "determinism: the state is complete",
        ),
    ]


def _different(part: NetworkResult, whole: NetworkResult, first: int) -> float:
    return float(
        sum(
            np.count_nonzero(channel.values[1:] != _values(whole, name)[first + 1 :])
            for name, channel in part.channels.items()
        )
    )


def _steps() -> list[Check]:
    valve = whole_valve()
    fine, usual, coarse = (
        _run(valve, 0.22e-3, step=step, coarse=m).events[0]
        for step, m in ((5e-9, 1), (STEP, 1), (STEP, 16))
    )
    return [
        check(
            "first impact on the stop, wet, 20 ns: peak force [N]",
            fine.peak_force,
            usual.peak_force,
            2e-4,
            "convergence: 5 ns",
        ),
        check(
            "first impact on the stop, wet, 20 ns: time [s]",
            fine.time,
            usual.time,
            2e-8,
            "convergence: 5 ns",
            absolute=True,
            reason="one step of 20 ns",
        ),
        check(
            "first impact on the stop, wet, coarse steps in flight: peak force [N]",
            usual.peak_force,
            coarse.peak_force,
            1e-3,
            "convergence: 20 ns all the time",
        ),
        check(
            "first impact on the stop, wet, coarse steps in flight: time [s]",
            usual.time,
            coarse.time,
            2e-8,
            "convergence: 20 ns all the time",
            absolute=True,
            reason="one step of 20 ns",
        ),
    ]


def _rest() -> Check:
    valve = whole_valve(damping=0.0, driver=component("voltage-step", voltage=12.0, start=1.0))
    result = _run(valve, 1e-3, coarse=16)
    moved = max(
        float(np.ptp(channel.values))
        for name, channel in result.channels.items()
        if name.endswith("displacement")
    )
    return check(
        "closed valve under spring and pressure, motion within 1 ms [m]",
        0.0,
        moved,
        5e-14,
        "statics: the start is in equilibrium; its springs are pressed by 70 nm",
    )


def _reciprocity() -> Check:
    def answer(push: str, watch: str) -> np.ndarray:
        result = _run(
            Network(
                {
                    "rod": FlexibleBody.of(steel_rod("rod", 0.04, 20)),
                    "pulse": component(
                        "force-over-time", time=(0.0, 1e-6, 2e-6), force=(0.0, 10.0, 0.0)
                    ),
                },
                [[f"rod.{push}", "pulse.end"]],
            ),
            60e-6,
            free=True,
        )
        return _values(result, f"rod.{watch} displacement")

    there, back = answer("bottom", "top"), answer("top", "bottom")
    return check(
        "pulse at one end of a rod, answer at the other, exchanged [-]",
        0.0,
        float(np.abs(there - back).max() / np.abs(there).max()),
        5e-14,
        "reciprocity (Maxwell, Betti)",
    )


def _kernel() -> Check:
    a, b, law = steel_rod("a", 0.04, 20), steel_rod("b", 0.1, 40, clamped=True), LinearLaw(1e9)
    # they touch just before a step ends: a network cuts this step there, the kernel does not
    gap = 1e-6 - 1e-15
    history = simulate_impact(
        one_contact(a, b, law, gap=gap, series=1e-9), speed=1.0, step=STEP, duration=40e-6
    )
    result = _run(
        Network(
            {
                "a": FlexibleBody.of(a, speed=-1.0),
                "b": FlexibleBody.of(b),
                "stop": component(
                    "end-stop",
                    gap=gap,
                    law=LinearStopLaw(kind="linear", stiffness=1e9),
                    series_compliance=1e-9,
                ),
            },
            [["a.bottom", "stop.upper"], ["b.top", "stop.lower"]],
        ),
        40e-6,
        free=True,
    )
    record = result.interfaces["stop"]
    force = record.contact_force
    return check(
        "two rods, peak force [N]",
        float(history.force.max()),
        float(force.max()),
        1e-13,
        "the impact kernel of klack, coded independently: 60 modes, 1e9 N/m before 1e-9 m/N",
        curve=ComparedCurve(
            x_label="time [us]",
            y_label="force [N]",
            expected=(history.time * 1e6, history.force),
            computed=(record.time * 1e6, force),
        ),
    )


def _half_sine() -> list[Check]:
    mass, k, speed = 2e-3, 1e9, 0.4
    network = Network(
        {
            "mass": component("rigid-mass", mass=mass, speed=-speed),
            "stop": component(
                "end-stop", gap=0.5e-6, law=LinearStopLaw(kind="linear", stiffness=k)
            ),
        },
        [["mass.body", "stop.upper"], ["stop.lower", "ground"]],
    )
    event = _run(network, 12e-6, step=1e-9, record=1e-8, free=True).events[0]
    source = "half sine: F = v sqrt(k m)"
    return [
        check("mass on a spring, peak force [N]", speed * sqrt(k * mass), event.peak_force, 1e-6,
               source),
        check("mass on a spring, restitution [-]", 1.0, event.restitution, 1e-13, source),
    ]  # fmt: skip


class _BareFilm(Component):
    """A film with given coefficients, perhaps before a compliance."""

    type: ClassVar[str] = "bare-film"
    ports: ClassVar[Mapping[str, Port]] = {"upper": ELEMENT, "lower": ELEMENT}

    gap: Length
    cubic: float
    cut_off: Length
    series: Compliance = 0.0

    def add_rows(self, rows: Rows) -> None:
        rows.interface(
            upper=rows.port("upper"),
            lower=rows.port("lower"),
            gap=self.gap,
            law=None,
            series_compliance=self.series,
            film=FilmRow(cubic=self.cubic, linear=0.0, cut_off=self.cut_off, suction=NEVER),
        )


def _on_a_film(
    film: _BareFilm,
    duration: float,
    *,
    mass: float,
    speed: float = 0.0,
    press: float = 0.0,
    step: float = STEP,
) -> NetworkResult:
    return _run(
        Network(
            {
                "mass": component("rigid-mass", mass=mass, speed=-speed),
                "load": component("constant-force", force=-press),
                "film": film,
            },
            [
                ["mass.body", "film.upper", "load.end"],
                ["film.lower", "ground"],
            ],
        ),
        duration,
        step=step,
        record=step,
        free=True,
    )


def _films() -> list[Check]:
    B = 9.248221602e-16
    plate = _on_a_film(_BareFilm(gap=25e-6, cubic=B, cut_off=1e-12), 60e-6, mass=1e-10, press=10.0)
    fall = float(
        np.diff(np.interp([20e-6**-2, 1e-6**-2], _values(plate, "film gap") ** -2, plate.time))[0]
    )
    slow = _on_a_film(
        _BareFilm(gap=20e-6, cubic=5e-17, cut_off=0.3e-6), 4e-4, mass=3e-3, speed=0.02, step=1e-6
    )
    x0, x1 = 20.3e-6, float(_values(slow, "film gap")[-1]) + 0.3e-6
    series = _on_a_film(
        _BareFilm(gap=10e-6, cubic=5e-17, cut_off=1e-8, series=1e-9), 40e-6, mass=3e-3, speed=0.4
    )
    peak, state = film_by_ode(
        rigid_mass_body("needle", 3e-3, port="bottom"),
        fixed_body("wall", port="top"),
        FilmRow(cubic=5e-17, linear=0.0, cut_off=1e-8, suction=NEVER),
        series=1e-9,
        gap=10e-6,
        speed=0.4,
        duration=40e-6,
        relative=1e-10,
    )
    radau = "Radau IIA at 1e-10; ours 20 ns"
    return [
        check(
            "plate pressed by 10 N falls from 20 to 1 um [s]",
            0.5 * B / 10.0 * (1e-6**-2 - 20e-6**-2),
            fall,
            1e-5,
            "Stefan 1874: B/(2F)(1/h2^2 - 1/h1^2)",
        ),
        check(
            "momentum lost in a film, 1 us steps [N s]",
            0.5 * 5e-17 * (x1**-2 - x0**-2),
            3e-3 * float(_values(slow, "mass velocity")[-1] + 0.02),
            2e-11,
            "B/2 (1/h1^2 - 1/h0^2)",
        ),
        check(
            "3 g, 0.4 m/s on a film before 1e9 N/m: peak force [N]",
            peak,
            float(series.interfaces["film"].film_force.max()),
            5e-5,
            radau,
        ),
        check(
            "the same, speed after 40 us [m/s]",
            float(state[1] / np.sqrt(3e-3)),
            float(_values(series, "mass velocity")[-1]),
            5e-4,
            radau,
        ),
    ]


def _surge() -> list[Check]:
    """Flow starts at one end of a line whose other end holds its pressure."""
    pressure, flow, duration = 5e5, 2e-6, 70e-6
    fluid = library_fluid("n-heptane").at(293.15)
    line = component("line", length=0.06, diameter=2.5e-3, pressure=pressure, friction="none")
    parts: dict[str, Component] = {
        "needle": component("rigid-mass", mass=1e-3),  # every network has one
        "spring": component("spring", stiffness=1e4, preload=0.0),
        "pump": FlowSource(flow=0.0, step=FlowStep(to=flow, at=1e-6, rise=1e-6)),
        "room": component("chamber", volume=1e-12, pressure=pressure),
        "line": line,
        "tank": component("pressure-source", pressure=pressure),
    }
    network = Network(
        parts,
        [
            ["needle.body", "spring.end"],
            ["pump.b", "room.fluid", "line.a"],
            ["line.b", "tank.fluid"],
        ],
        ambient=Ambient(pressure=pressure),
        fluid=fluid,
    )
    result = _run(network, duration, record=1e-6)
    echo = line.echo_time(fluid)
    assert duration < echo
    rho, a = float(fluid.density(pressure)), line.wave_speed(fluid)
    rise = rho * a * flow / (pi / 4 * 2.5e-3**2)
    return [
        check(
            "flow that starts at a line, rise of pressure until the echo [Pa]",
            rise,
            float(_values(result, "room pressure")[-1]) - pressure,
            5e-4,
            "Joukowsky 1898: rho a v; first order in dp/K",
        ),
        check(
            "the same, after the echo of the open end [Pa]",
            -rise,
            float(_values(_run(network, echo + 20e-6, record=1e-6), "room pressure")[-1])
            - pressure,
            5e-4,
            "the wave comes back with the opposite sign: dp - 2 dp",
        ),
        check(
            "the same, energy residual [-]",
            0.0,
            result.books.relative_residual,
            5e-12,
            IDENTITY,
        ),
    ]


def _coil() -> list[Check]:
    turns, R, gap, radius, leakage, voltage = 80.0, 1.2, 200e-6, 3e-3, 5e-8, 24.0
    parts: dict[str, Component] = {
        "armature": component("rigid-mass", mass=1e4),  # moves by a nanometre
        "coil": component(
            "solenoid",
            turns=turns,
            resistance=R,
            gap=gap,
            residual_gap=50e-6,
            poles=(PoleGap(outer_radius=radius, fringing="none"),),
            leakage=leakage,
        ),
        "driver": component("voltage-step", voltage=voltage),
    }
    result = _run(
        Network(
            parts, [["armature.body", "coil.armature"], ["coil.terminals", "driver.terminals"]]
        ),
        0.5e-3,
        free=True,
        record=0.1e-6,
    )
    permeance = VACUUM_PERMEABILITY * pi * radius**2 / (gap + 50e-6)
    inductance = turns**2 * (permeance + leakage)
    current = voltage / R * (1.0 - exp(-R * result.time[-1] / inductance))
    flux = permeance * turns * current
    return [
        check(
            "current of a coil switched on, after 0.5 ms [A]",
            current,
            float(_values(result, "coil current")[-1]),
            1e-5,
            "U/R (1 - exp(-R t/L)); implicit midpoint, order 2",
            curve=ComparedCurve(
                x_label="time [ms]",
                y_label="current [A]",
                expected=(
                    result.time * 1e3,
                    -voltage / R * np.expm1(-R * result.time / inductance),
                ),
                computed=(result.time * 1e3, _values(result, "coil current")),
            ),
        ),
        check(
            "force on the armature then [N]",
            flux**2 / (2.0 * VACUUM_PERMEABILITY * pi * radius**2),
            float(_values(result, "coil.armature force")[-1]),
            5e-4,
            "Maxwell: phi^2/(2 mu0 A); mean over 0.1 us",
        ),
        check("coil and armature, energy residual [-]", 0.0, result.books.relative_residual, 5e-13,
               IDENTITY),
    ]  # fmt: skip
