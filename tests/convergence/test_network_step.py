"""Steps of networks.

Convergence with the step, through boost, peak, fall, two-point hold and decay.

Truth: order of convergence over the step and over the segments.

Truth: order two of film, asperities and compliance together, on two rods of 60 modes.

Truth: an impact and the rest after it belong to the valve, not to the steps (convergence).

Macro steps: first impacts over phases of the grid against fine steps alone, and their sizes.
"""

from collections.abc import Mapping

import numpy as np
import pytest

from klack.contact.laws import LinearLaw
from klack.errors import InputError
from klack.hydraulics.line_friction import KAGAWA, laminar_resistance, unsteady_terms
from klack.magnetics.peak_hold import PeakHold
from klack.mechanics.end_stop import EndStop
from klack.mechanics.flexible_body import FlexibleBody
from klack.mechanics.force import ForceOverTime
from klack.mechanics.rigid_mass import RigidMass
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import FilmRow, Rows
from klack.simulation.bodies import rod_body
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.simulation.step_sizes import step_sizes
from klack.verification.drivers import injector, opening, run_coil
from klack.verification.interface_motion import interface_motion
from klack.verification.network import peak_and_hold, whole_valve
from klack.verification.one_dimension import steel_rod
from klack.verification.single_line import End, exponential_decay, plain_line, ringing, run_line

DRIVER = PeakHold(
    boost_voltage=65.0,
    peak_current=10.0,
    supply_voltage=14.0,
    hold_current=3.0,
    hold_band=1.0,
    end=150e-6,
    decay=50.0,
).program()


def values(steps):
    step = 200e-6 / steps
    r = run_coil(
        injector(),
        DRIVER,
        resistance=0.8,
        gap=100e-6,
        step=step,
        lift=opening(200e-6, step),
    )
    return np.array([r.flux[-1], r.work, r.electric])


def test_long_steps_are_cut_where_the_fluxes_bend():
    """Saturation, switchings, eddy currents; uncut, the supply is 30 times as far off."""
    errors = np.abs(values(156) / values(128000) - 1.0)  # steps of 1.28 us

    assert np.all(errors < [4e-5, 2e-4, 1e-4])


def test_flux_work_and_supply_converge():
    """Uncut steps have order two; the error allowed of cut ones falls with the square."""
    counts = np.array([400, 800, 1600, 3200])
    errors = np.abs(np.array([values(n) / values(128000) - 1.0 for n in counts]))

    orders = -np.polyfit(np.log(counts), np.log(errors), 1)[0]

    # switchings fall anywhere inside the steps: the constant wobbles; the longest are cut as finely
    # as those of 0.32 us, so that the order looks lower than it is
    assert np.all(orders > 1.1)
    assert np.all(errors[-1] < 2.5e-6)  # uncut steps of 62.5 ns: 2e-6 to 1.3e-5


@pytest.mark.parametrize("coarse", [1, 4])
def test_fractional_delay_is_of_second_order(coarse):
    delay, duration, omega = 1.0, 1.9, 2.0 * np.pi
    errors, counts = [], np.array([20, 40, 80, 160])
    for n in counts:
        step = delay / (n + 0.5) / coarse  # half a step left over: the worst case
        steps = int(duration / step / coarse)
        edges = step * coarse * np.arange(steps + 1)
        flow = -np.diff(np.cos(omega * edges)) / omega / (step * coarse)  # means of a sine
        row = plain_line(delay=delay, impedance=1.0)

        run = run_line(
            row, End(flow=flow), End(flow=0.0), step=step, lengths=np.full(steps, coarse)
        )

        late = np.maximum(edges - delay, 0.0)
        exact = -2.0 * np.diff(np.cos(omega * late)) / omega / (step * coarse)
        smooth = edges[:-1] > delay + 2.0 * step * coarse  # the sine starts with a kink
        errors.append(np.max(np.abs(run.pressure[smooth, 1] - exact[smooth])))

    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]

    assert order == pytest.approx(2.0, abs=0.15)


def test_lumps_approach_spread_friction_with_order_two():
    rho, speed, viscosity, length, radius = 870.0, 1370.0, 0.04, 0.06, 1.25e-3
    delay, nu = length / speed, viscosity / rho
    resistance = laminar_resistance(length, 2.0 * radius, viscosity)
    terms = unsteady_terms(
        KAGAWA, resistance=resistance, diameter=2.0 * radius, kinematic_viscosity=nu
    )
    exact = exponential_decay(KAGAWA, delay=delay, radius=radius, kinematic_viscosity=nu)
    counts, errors = np.array([2, 4, 8]), []
    for segments in counts:
        row = plain_line(
            delay=delay,
            impedance=rho * speed / (np.pi * radius**2),
            segments=int(segments),
            resistance=resistance,
            unsteady=terms,
        )
        step = delay / 1600
        run = run_line(
            row,
            End(pressure=0.0),
            End(flow=0.0),
            step=step,
            lengths=np.ones(round(30.0 * delay * 4.0 / step), int),
            pressure=[0.0, 1e5],
        )
        tone = ringing(run.time, run.pressure[:, 1], exact.imag / (2 * np.pi), apart=8 * delay)
        errors.append(abs(tone / exact - 1.0))

    assert errors[-1] < 2e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.4)


@pytest.mark.parametrize("suction", [1e9, 0.6], ids=["pulling", "cavitating"])
def test_rods_with_asperities_in_a_film(suction):
    a, b = steel_rod("a", 0.04, 20), steel_rod("b", 0.08, 40)
    film = FilmRow(cubic=5e-17, linear=0.0, cut_off=0.2e-6, suction=suction)
    omega = np.concatenate([a.omega, b.omega])
    weight = np.concatenate([omega, np.ones(omega.size)])

    def run(n):
        return interface_motion(
            a,
            b,
            LinearLaw(1e10),
            film=film,
            series=1e-9,
            gap=5e-6,
            speed=0.5,
            step=60e-6 / n,
            steps=n,
        )

    fine = run(48_000)
    counts = np.array([750, 1500, 3000, 6000])
    runs = [run(int(n)) for n in counts]
    errors = [
        np.linalg.norm(weight * (m.state - fine.state)) / np.linalg.norm(weight * fine.state)
        for m in runs
    ]

    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    # the film ends and the contact begins somewhere inside one step: order 1, and scatter
    assert order > 0.7
    assert errors[2] < 1e-3  # 20 ns
    assert runs[2].peak_force == pytest.approx(fine.peak_force, rel=5e-4)
    assert runs[2].film_loss.sum() == pytest.approx(fine.film_loss.sum(), rel=1e-4)


LIFTED = 400e-6  # [s]


def rod() -> Component:
    body = rod_body(
        "needle", length=0.03, area=8e-6, young=2.1e11, density=7850.0, elastic_modes=5, damping=0.1
    )
    return FlexibleBody.of(body, ("bottom", "top"))


def dropped(needle: Component, step: float) -> NetworkResult:
    """A needle is pushed onto its seat, bounces, rests, and is pulled off at a known time."""
    parts: dict[str, Component] = {
        "needle": needle,
        "seat": EndStop(gap=5e-6, law={"kind": "linear", "stiffness": 2e8}, restitution=0.4),
        "force": ForceOverTime(time=(0.0, LIFTED, LIFTED + 1e-9), force=(-20.0, -20.0, 20.0)),
    }
    joints = [
        ["needle.bottom", "seat.upper"],
        ["needle.top", "force.end"],
        ["seat.lower", "ground"],
    ]
    return simulate_network(
        Network(parts, joints).rows(),
        duration=600e-6,
        step=step,
        coarse=16,
        record=1.28e-6,
        start="free",
    )


@pytest.mark.parametrize("kind", ["rigid", "rod"])
def test_impacts_and_rest_do_not_depend_on_the_step(kind):
    """Also of a rest: it ends when the needle is pulled off, and what hit it does not come back."""
    coarse, fine = (
        dropped(RigidMass(mass=2e-3, points=("bottom", "top")) if kind == "rigid" else rod(), step)
        for step in (20e-9, 2.5e-9)
    )

    for result in (coarse, fine):
        last = result.events[-1]
        assert last.restitution == 0.0
        assert LIFTED < last.separation_time < LIFTED + 8e-6  # a wave through the rod takes 5.8 us
        assert last.contact_time < 0.2 * LIFTED
        assert result.coarse_steps > 0
        record = result.interfaces["seat"]
        before_rest = record.time < last.time + last.contact_time
        assert np.max(record.step[before_rest]) < 4.1 * result.step  # four while it is smooth
        closed = record.contact_force > 0.0
        time = np.sum(record.step[closed & (record.time > last.time)])
        assert time == pytest.approx(last.separation_time - last.time, rel=0.05)
    first = (coarse.events[0], fine.events[0])
    for name in ("peak_force", "contact_time", "impulse"):
        one, other = (getattr(event, name) for event in first)
        assert one == pytest.approx(other, rel=5e-3)
    assert coarse.events[-1].contact_time == pytest.approx(fine.events[-1].contact_time, rel=0.1)
    assert coarse.events[-1].separation_time == pytest.approx(
        fine.events[-1].separation_time, abs=0.1e-6
    )


MACRO = 1.28e-6


def stroke(kind: str, shift: float, **steps) -> NetworkResult:
    """Open, rebound from the stop, and fall onto the seat; the driver starts a little later."""
    start = 2e-6 + shift
    valve = whole_valve(driver=peak_and_hold(start=start, end=start + 0.45e-3))
    valve = valve if kind == "wet" else valve.dry()
    return simulate_network(valve.rows(), duration=0.9e-3, record=1.28e-6, **steps)


def first_impacts(result: NetworkResult, shift: float) -> Mapping[str, tuple[float, float]]:
    """Peak [N] and time since the start of the driver [s] at each stop, once it has opened."""
    found: dict[str, tuple[float, float]] = {}
    for event in result.events:
        if event.time > 50e-6:
            found.setdefault(event.stop, (event.peak_force, event.time - shift))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["wet", "dry"])
def test_first_impacts_do_not_depend_on_the_phase_of_the_grid(kind):
    """Truth: convergence, fine steps of 2.5 ns alone.  One run at one phase would be luck."""
    exact = first_impacts(stroke(kind, 0.0, step=2.5e-9, coarse=1), 0.0)
    shifts = (MACRO + 20e-9) * np.arange(8) / 8
    runs = [stroke(kind, shift) for shift in shifts]
    found = [first_impacts(run, shift) for run, shift in zip(runs, shifts, strict=True)]

    for stop, (peak, time) in exact.items():
        peaks = np.array([impacts[stop][0] for impacts in found]) / peak - 1.0
        times = np.array([impacts[stop][1] for impacts in found]) - time
        # the same scheme with backward Euler, the lift at the end of a step, or uncut steps: 0.2 us
        assert np.abs(peaks).max() < 5e-4, stop
        # wet: a film ceases to pull in steps of 20 ns; seven of the eight are below 0.02 us
        assert np.abs(times).max() < (0.08e-6 if kind == "wet" else 0.05e-6), stop
    for run in runs:
        assert run.steps.fine == 0
        assert run.steps.flight > 300
        assert run.steps.near > 100
        assert run.steps.repeats < 0.2 * run.coarse_steps
        assert run.books.relative_residual < 1e-11


@pytest.mark.slow
def test_fine_accuracy_is_finer():
    exact = first_impacts(stroke("wet", 0.0, step=2.5e-9, coarse=1), 0.0)
    normal, fine = (
        first_impacts(stroke("wet", 0.0, accuracy=accuracy), 0.0) for accuracy in ("normal", "fine")
    )

    peak, time = exact["opening"]
    # normal steps happen to be off by 2e-6 only, as the truth in steps of 2.5 ns itself
    assert abs(fine["opening"][0] / peak - 1.0) < 1e-5
    assert abs(fine["opening"][1] - time) < 2.6e-9  # a part of a step
    peak, time = exact["seat"]
    assert abs(fine["seat"][0] / peak - 1.0) < 0.3 * abs(normal["seat"][0] / peak - 1.0)
    assert abs(fine["seat"][1] - time) < 0.02e-6


def with_line(delay: float, segments: int) -> Rows:
    rows = valve().rows()
    rows.lines.clear()
    rows.line(a=0, b=1, delay=delay, impedance=1e9, segments=segments)
    return rows


def valve() -> Network:
    return whole_valve(modes=(2, 2, 2)).dry()


def test_macro_steps_are_as_long_as_lines_and_exchanges_allow():
    def sizes(rows: Rows, **more) -> tuple[int, int]:
        found = step_sizes(rows, "normal", **more)
        return found.coarse, found.near

    assert sizes(valve().rows()) == (64, 16)
    assert sizes(valve().rows(), step=50e-9) == (16, 4)
    assert sizes(valve().rows(), step=5e-6) == (1, 1)
    assert sizes(valve().rows(), coarse=10) == (10, 2)
    assert sizes(with_line(1e-6, 3)) == (16, 4)  # 333 ns
    assert sizes(with_line(30e-9, 1)) == (1, 1)
    rows = valve().rows()
    rows.element(rows.elements[0].step, ports=(0,), parameters=(0.0,), interval=0.5e-6)
    assert sizes(rows) == (25, 5)  # one exchange in each macro step


@pytest.mark.parametrize(
    ("more", "expected"),
    [({"accuracy": "better"}, "normal, fine"), ({"coarse": 0}, "1 or more")],
)
def test_what_is_no_size_is_refused(more, expected):
    with pytest.raises(InputError, match=expected):
        simulate_network(valve().rows(), duration=1e-5, **more)
