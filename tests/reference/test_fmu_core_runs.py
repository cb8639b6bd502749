"""FMUs of klack against klack's own runs, in steps and by CVODE.

Co-simulation against klack's own runs of the same bodies: impact kernel, interface, network.

The C core repeats the same steps, so only round-off may differ; but for those in which a contact
opens or closes, which the network cuts: there both converge to the same motion.

Model exchange with CVODE of SUNDIALS against co-simulation in steps of 1 ns.

Both live in one FMU and share the forces of a state only: CVODE integrates the equations its own
way, with first touch and release as events.
"""

from dataclasses import replace

import numpy as np
import pytest
from c_compiler import needs_compiler
from energy_ledger import allowed

from klack.contact.laws import HertzLaw, HuntCrossley, LinearLaw, TableLaw, gonthier_coefficient
from klack.exchange.fmu.build import build_fmu, source_texts
from klack.exchange.fmu.compiler import compile_library, this_platform
from klack.exchange.fmu.model_description import SOURCE_FILES
from klack.exchange.fmu.variables import fmu_variables
from klack.exchange.modal_model import Provenance, pair_model
from klack.mechanics.force import constant_force_step
from klack.network.rows import Ambient, Book, FilmRow, Rows
from klack.simulation.bodies import rigid_mass_body, rod_body
from klack.simulation.impact import simulate
from klack.simulation.network_run import simulate_network
from klack.simulation.system import AxialForce, ContactPair, ReducedSystem, ReturnSpring
from klack.verification.interface_motion import interface_motion
from klack.verification.one_dimension import one_contact

pytestmark = [pytest.mark.slow, needs_compiler]


fmpy = pytest.importorskip("fmpy")

STEEL = {"young": 2.1e11, "density": 7850.0}
STEP = 20e-9  # [s]
MADE = Provenance(case="rods", title="Rods", version="1", created="2026-01-01T00:00:00")
FILM_LEFT = 1e-10  # a step accepts a force to 1e-11 of it
ROUND_OFF = 1e-11  # of the largest value, after thousands of steps; 3e-14 was seen
TABLE = TableLaw(np.array([0.2, 0.5, 1.0, 2.0]) * 1e-6, [20.0, 70.0, 190.0, 520.0])
FILM = FilmRow(cubic=5e-17, linear=4e-12, cut_off=0.3e-6, suction=2.0)


def needle(modes=8, damping=0.0):
    return rod_body(
        "needle", length=0.03, area=1.2e-5, elastic_modes=modes, damping=damping, **STEEL
    )


def held(name, modes=12, length=0.05):
    return rod_body(name, length=length, area=6e-5, elastic_modes=modes, support="bottom", **STEEL)


def on_seat(upper, law, *, gap=0.1e-6, series=0.0, **more):
    port = "bottom" if "bottom" in upper.port_names else "contact"
    contact = ContactPair(
        body_a=upper.name,
        port_a=port,
        body_b="seat",
        port_b="top",
        law=law,
        gap=gap,
        series_compliance=series,
    )
    return ReducedSystem(bodies=(upper, held("seat")), contacts=(contact,), **more)


def model_of(system, *, speed=0.0, films=(), step=STEP):
    return pair_model(
        "rods",
        system,
        moving="needle",
        contact_names=[f"stop_{i}" for i in range(len(system.contacts))],
        films=films,
        speed=speed,
        step=step,
        duration=1e-4,
        provenance=MADE,
    )


def compiled(model, folder):
    """Binary alone, where an unpacked FMU has it: faster than a whole FMU."""
    sources, binaries = folder / "sources", folder / "binaries" / "linux64"
    sources.mkdir()
    binaries.mkdir(parents=True)
    for name, text in source_texts(model, 2, "guid").items():
        (sources / name).write_bytes(text)
    compile_library(
        [sources / name for name in SOURCE_FILES[2]],
        [sources],
        binaries / f"{model.name}.so",
        platform=this_platform(),
    )


class Unit:
    """A model compiled for co-simulation and started."""

    def __init__(self, model, folder, **start):
        from fmpy.fmi2 import FMU2Slave

        compiled(model, folder)
        self.references = {v.name: i for i, v in enumerate(fmu_variables(model))}
        self.fmu = FMU2Slave(guid="guid", unzipDirectory=folder, modelIdentifier=model.name)
        self.fmu.instantiate()
        self.restart(**start)

    def restart(self, **start):
        self.fmu.reset()
        self.fmu.setupExperiment()
        self.set(**start)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def set(self, **values):
        self.fmu.setReal([self.references[name] for name in values], list(values.values()))

    def get(self, *names):
        return np.array(self.fmu.getReal([self.references[name] for name in names]))

    def run(self, steps, span, *names):
        out = np.empty((steps, len(names)))
        for i in range(steps):
            self.fmu.doStep(i * span, span)
            out[i] = self.get(*names)
        return out


def differ(a, b):
    return np.max(np.abs(a - b)) / np.max(np.abs(b))


CASES = {
    "pressed, damped modes": on_seat(
        needle(damping=0.01), LinearLaw(1e9), forces=(AxialForce(body="needle", force=-40.0),)
    ),
    "spring": on_seat(
        needle(),
        LinearLaw(1e9),
        springs=(ReturnSpring(body="needle", port="top", stiffness=2e4, preload=15.0),),
    ),
    "table": on_seat(needle(), TABLE),
    "in series": on_seat(needle(), TABLE, series=1e-9),
    "Hunt-Crossley": on_seat(
        rigid_mass_body("needle", 3e-3), HuntCrossley(HertzLaw(1.5e12), gonthier_coefficient(0.7))
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_co_simulation_repeats_the_impact_kernel(name, tmp_path):
    system, per_step, steps = CASES[name], 25, 120
    native = simulate(
        system,
        velocities={"needle": -0.4},
        step=STEP,
        duration=steps * per_step * STEP,
        steps_per_record=per_step,
    )
    own = Unit(model_of(system, speed=-0.4), tmp_path).run(
        steps, per_step * STEP, "mean_contact_force", "peak_contact_force", "velocity", "gap"
    )

    force = native.force[:, 0]
    assert np.count_nonzero(force) > 10
    assert np.any(force[-20:] == 0.0) or "pressed" in name
    assert differ(own[:, 0], force) < ROUND_OFF
    assert own[:, 1].max() == pytest.approx(native.peak_force.max(), rel=ROUND_OFF)
    assert differ(own[:, 2], native.velocity[1:, 0]) < ROUND_OFF
    y = native.displacement[1:, 0, 0] - native.displacement[1:, 0, 1]
    assert differ(own[:, 3], system.contacts[0].gap + y) < ROUND_OFF


def of_size(size, law, *, series=0.0, young=2.1e11, density=7850.0):
    """Rod on its like: everything counts in its length, ``law`` gets its stiffness [N/m]."""
    material = {"young": young, "density": density, "area": 1e-2 * size**2, "length": size}
    k = young * material["area"] / size
    contact = ContactPair(
        body_a="needle",
        port_a="bottom",
        body_b="seat",
        port_b="top",
        law=law(k, 1e-5 * size),
        gap=1e-5 * size,
        series_compliance=series / k,
    )
    bodies = (
        rod_body("needle", elastic_modes=8, **material),
        rod_body("seat", elastic_modes=12, support="bottom", **material),
    )
    step = 2e-2 * size * (density / young) ** 0.5
    return ReducedSystem(bodies=bodies, contacts=(contact,)), step, 1e-5 * (young / density) ** 0.5


def hertz(k, depth):
    return HertzLaw(k / depth**0.5)


def lossy(k, depth):
    return HuntCrossley(hertz(k, depth), 3.0)


def table(k, depth):
    d = depth * np.array([0.2, 0.5, 1.0, 2.0])
    return TableLaw(d, k * depth * (d / depth) ** 1.5)


SIZES = {
    "soft rod of 1 m": of_size(1.0, hertz, young=1e7, density=1100.0),
    "soft rod of 1 m, table": of_size(1.0, table, young=1e7, density=1100.0),
    "valve of 30 um": of_size(30e-6, hertz),
    "valve of 30 um, table in series": of_size(30e-6, table, series=0.3),
    "lossy and clipped, in series": of_size(0.03, lossy, series=3.0),
    "lossy and clipped, in series, 30 um": of_size(30e-6, lossy, series=3.0),
}


@pytest.mark.parametrize("name", SIZES)
def test_co_simulation_repeats_the_impact_kernel_at_every_size(name, tmp_path):
    """Forces from 10 uN to 10 N: what a step accepts has to be a share of its force.

    With 1e-9 N, 3e-13 m and 1e-16 m instead, four of these are off by 2e-10 to 6e-6.
    """
    (system, step, speed), steps, per_step = SIZES[name], 200, 3
    native = simulate(
        system,
        velocities={"needle": -speed},
        step=step,
        duration=steps * per_step * step,
        steps_per_record=per_step,
    )
    unit = Unit(model_of(system, speed=-speed, step=step), tmp_path)

    own = unit.run(steps, per_step * step, "mean_contact_force", "velocity", "gap")

    y = native.displacement[1:, 0, 0] - native.displacement[1:, 0, 1]
    assert np.count_nonzero(native.force) > 10
    assert np.any(native.force[-20:] == 0.0)
    assert differ(own[:, 0], native.force[:, 0]) < ROUND_OFF
    assert differ(own[:, 1], native.velocity[1:, 0]) < ROUND_OFF
    assert differ(own[:, 2], system.contacts[0].gap + y) < ROUND_OFF


def test_communication_step_changes_nothing(tmp_path):
    """Without forces from outside every division of the time gives the same motion."""
    system, total = on_seat(needle(), TABLE, series=1e-9), 3000
    native = simulate(system, velocities={"needle": -0.4}, step=STEP, duration=total * STEP)
    unit = Unit(model_of(system, speed=-0.4), tmp_path)

    for per_step in (1, 3, 100, 3000):
        unit.restart()
        own = unit.run(total // per_step, per_step * STEP, "peak_contact_force", "velocity")
        assert own[:, 0].max() == pytest.approx(native.peak_force.max(), rel=ROUND_OFF)
        assert own[-1, 1] == pytest.approx(native.velocity[-1, 0], rel=ROUND_OFF)


def between_two(law, gaps, series=(0.0, 0.0), **more):
    """Needle between its seat and a stop above it."""
    ends = (("needle", "bottom", "seat", "top"), ("stop", "top", "needle", "top"))
    contacts = tuple(
        ContactPair(
            body_a=a,
            port_a=pa,
            body_b=b,
            port_b=pb,
            law=law,
            gap=gap,
            series_compliance=compliance,
        )
        for (a, pa, b, pb), gap, compliance in zip(ends, gaps, series, strict=True)
    )
    bodies = (needle(), held("seat"), held("stop", 9, 0.04))
    return ReducedSystem(bodies=bodies, contacts=contacts, **more)


@pytest.mark.parametrize("series", [0.0, 1e-9])
def test_two_dry_contacts_repeat_the_impact_kernel(series, tmp_path):
    """Squeezed by waves: both contacts are closed at the same time now and then."""
    system = between_two(LinearLaw(8e8), (0.05e-6, 0.01e-6), (series, 0.0))
    native = simulate(
        system, velocities={"needle": -0.3}, step=STEP, duration=6e-5, steps_per_record=10
    )
    unit = Unit(model_of(system, speed=-0.3), tmp_path)

    names = [f"mean_contact_force_stop_{i}" for i in range(2)]
    own = unit.run(len(native.force), 10 * STEP, *names)

    assert np.any(np.all(native.force > 0.0, axis=1))
    assert differ(own, native.force) < ROUND_OFF


@pytest.mark.parametrize(
    ("law", "series", "film"),
    [
        (TABLE, 0.0, FILM),
        (TABLE, 2e-9, FILM),
        (LinearLaw(1e9), 1e-9, FilmRow(cubic=4e-18, linear=0.0, cut_off=0.6e-6, suction=0.2)),
        (LinearLaw(1e9), 1e-12, FILM),
        (None, 1e-9, FILM),
    ],
    ids=["parallel", "in series", "thin film", "stiff series", "film alone"],
)
def test_film_repeats_the_interface_step(law, series, film, tmp_path):
    upper, lower, steps = needle(), held("seat"), 6000
    native = interface_motion(
        upper,
        lower,
        law,
        film=film,
        series=series,
        gap=1e-6,
        speed=0.2,
        press=60.0,
        step=STEP,
        steps=steps,
    )
    model = model_of(on_seat(upper, law or TABLE, gap=1e-6, series=series), films=(film,))
    if law is None:
        model = replace(model, contacts=(replace(model.contacts[0], law=None),))
    unit = Unit(model, tmp_path, start_velocity=-0.2, force=-60.0)

    own = unit.run(steps // 20, 20 * STEP, "mean_contact_force", "film_force", "gap")

    mean = native.contact_force.reshape(-1, 20).mean(axis=1)
    assert native.film_force.max() > 1.0
    if law is not None:
        assert mean.max() > 10.0
        assert differ(own[:, 0], mean) < FILM_LEFT
    assert differ(own[:, 1], native.film_force[19::20]) < FILM_LEFT
    assert differ(own[:, 2], native.gap[20::20]) < ROUND_OFF


def test_two_contacts_with_films_converge_to_the_network(tmp_path):
    """Truth: convergence with the step.  Up against the stop, then, turned round, to the seat.

    The network cuts the steps in which a contact closes and opens, the FMU takes them whole.
    """
    apart = [_apart_from_network(tmp_path / f"{share}", STEP / share) for share in (1, 16)]

    assert apart[0] < 5e-4  # of the largest values; 2.2e-4 was seen
    assert apart[1] < 0.5 * apart[0]


def _apart_from_network(folder, step):
    folder.mkdir()
    films = (FILM, FilmRow(cubic=9e-17, linear=0.0, cut_off=0.5e-6, suction=3.0))
    system = between_two(TABLE, (0.0, 2e-6), (2e-9, 1e-9))
    unit = Unit(model_of(system, films=films, step=step), folder, force=50.0)
    half, span = 150, 1e-6
    forces = np.repeat([50.0, -50.0], half)

    own = np.empty((2 * half, 3))
    for i, force in enumerate(forces):
        unit.set(force=force)
        unit.fmu.doStep(i * span, span)
        own[i] = unit.get("velocity", "mean_contact_force_stop_0", "mean_contact_force_stop_1")

    with allowed("simulate_network", 1e-6):  # stiff stops: what the forces do not settle, 2e-7
        native = network_run(system, films, (50.0, -50.0), half * span, span, step)
    assert np.min(np.max(np.abs(native), axis=1)) > 0.05
    return max(differ(own[:, column], channel) for column, channel in enumerate(native))


def network_run(system, films, forces, half, span, step):
    """Velocity of the needle and both contact forces; the force acts over its mass."""
    rows, state, found = None, None, []
    for force in forces:
        rows = rows_of(system, films, force)
        result = simulate_network(
            rows, duration=half, step=step, coarse=1, record=span, start="free", state=state
        )
        state = result.state
        found.append(
            [
                result.channels[name].values[1:]
                for name in ("needle velocity", "stop_0 contact force", "stop_1 contact force")
            ]
        )
    return [np.concatenate(parts) for parts in zip(*found, strict=True)]


def rows_of(system, films, force):
    rows, handle = Rows(ambient=Ambient()), 0
    place = {}
    for body in system.bodies:
        if body.name == "needle":  # a port that spreads a force over the mass
            spread = np.zeros(body.mode_count)
            spread[: body.rigid_count] = body.rigid_axial / body.mass
            body = replace(
                body,
                port_names=(*body.port_names, "mass"),
                port_shapes=np.column_stack([body.port_shapes, spread]),
                static_compliance=np.pad(body.static_compliance, (0, 1)),
            )
        rows.component = body.name
        rows.handles = {name: handle + i for i, name in enumerate(body.port_names)}
        place |= {(body.name, name): h for name, h in rows.handles.items()}
        rows.body(body, body.port_names)
        handle += len(body.port_names)
    rows.component, rows.handles = "force", {"end": place["needle", "mass"]}
    rows.element(
        constant_force_step,
        ports=(place["needle", "mass"],),
        parameters=(force,),
        books=(Book("work", "supply"),),
    )
    for i, (contact, film) in enumerate(zip(system.contacts, films, strict=True)):
        rows.component = f"stop_{i}"
        rows.interface(
            upper=place[contact.body_a, contact.port_a],
            lower=place[contact.body_b, contact.port_b],
            gap=contact.gap,
            law=contact.law,
            series_compliance=contact.series_compliance,
            film=film,
        )
    return rows


STEP_EXCHANGE = 1e-9  # [s]
SPEED = 0.4  # [m/s]
ROD = rod_body("needle", length=0.03, area=1.2e-5, elastic_modes=4, damping=0.01, **STEEL)
BALL = rigid_mass_body("needle", 3e-3, port="bottom")

CASES_EXCHANGE = {
    "linear": (ROD, LinearLaw(1e9), 0.0, None),
    "table": (ROD, TABLE, 0.0, None),
    "in series": (ROD, TABLE, 1e-9, None),
    "Hunt-Crossley": (BALL, HuntCrossley(HertzLaw(1.5e12), 0.2), 0.0, None),
    "film": (ROD, TABLE, 0.0, FILM),
}


@pytest.mark.parametrize("name", CASES_EXCHANGE)
def test_cvode_agrees_with_fine_steps(name, tmp_path):
    upper, law, series, film = CASES_EXCHANGE[name]
    seat = rod_body("seat", length=0.05, area=6e-5, elastic_modes=8, support="bottom", **STEEL)
    model = pair_model(
        "rods",
        one_contact(upper, seat, law, gap=2e-6, series=series),
        moving="needle",
        contact_names=["seat"],
        films=(film,),
        speed=-SPEED,
        step=STEP_EXCHANGE,
        duration=4e-5,
        provenance=MADE,
    )
    path, names = build_fmu(model, tmp_path / "it.fmu", fmi=2), ["lift", "gap", "contact_force"]

    def run(kind, **more):
        found = fmpy.simulate_fmu(
            str(path),
            fmi_type=kind,
            stop_time=4e-5,
            output_interval=0.2e-6,
            output=names,
            record_events=False,
            **more,
        )
        return [np.asarray(found[name]) for name in ("time", *names)]

    time, lift, gap, force = run("ModelExchange", solver="CVode", relative_tolerance=1e-10)
    own_time, own_lift, own_gap, own_force = run("CoSimulation")

    assert time == pytest.approx(own_time)
    assert np.count_nonzero(own_force) > 30
    assert own_force[-1] == 0.0
    # the force of the last step of 1 ns is that of half a nanosecond before
    slack = np.max(np.abs(np.diff(own_force))) * 0.5 * STEP_EXCHANGE / 0.2e-6
    assert np.max(np.abs(force - own_force)) < 1e-4 * own_force.max() + slack
    assert force.max() == pytest.approx(own_force.max(), rel=1e-4)
    # in the step of release a film may pull a whole step instead of a part of it
    late = FILM.suction * STEP_EXCHANGE / (upper.mass * 0.5 * SPEED) if film else 0.0
    assert np.max(np.abs(lift - own_lift)) < (1e-6 + late) * np.max(np.abs(own_lift))
    assert np.max(np.abs(gap - own_gap)) < (1e-6 + late) * np.max(np.abs(own_gap))
