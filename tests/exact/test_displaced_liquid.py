"""Liquid that a body displaces: its added mass in a run, and in the note of a run without it.

Truth: closed formulas, ``sqrt(k/(m + rho l A_b^2/A))`` and two masses on springs.  Inertances in
parallel.
"""

import re
from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest

from klack.hydraulics.annulus import Annulus
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.inertance import Inertance
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.simulation.displaced_liquid import liquid_doubts, told_once
from klack.simulation.network_result import ChannelData
from klack.simulation.network_run import simulate_network
from klack.units import MASS as MASSES
from klack.units import parse_quantity

pytestmark = pytest.mark.filterwarnings("ignore::klack.network.checks.LooseBodyWarning")

HEPTANE = library_fluid("n-heptane").at(293.15)
AMBIENT = 101_325.0
RHO = float(HEPTANE.density(AMBIENT))
BULK = float(HEPTANE.bulk_modulus(AMBIENT))
MASS, STIFFNESS, PUSH = 3e-3, 1e5, 1.0
FACE = 5e-3  # diameter
AREA = pi / 4.0 * FACE**2
VOLUME = 20e-9
GAP = Annulus(diameter=4e-3, length=5e-3, clearance=150e-6)
HOLE = Orifice(diameter=1.2e-3)


def network(passages, volume=VOLUME, before=None, fluid=HEPTANE):
    """A mass on a spring whose face displaces a chamber between passages and a tank."""
    parts = {
        "mass": RigidMass(mass=MASS),
        "spring": Spring(stiffness=STIFFNESS, preload=PUSH),
        "face": PressureFace(direction="opening", outer_diameter=FACE),
        "room": Chamber(volume=volume, pressure=AMBIENT),
        "tank": PressureSource(pressure=AMBIENT),
        **passages,
    }
    room, tank = ["room.fluid", "face.fluid"], ["tank.fluid"]
    joints = [["mass.body", "spring.end", "face.body"]]
    mouth = room
    if before is not None:
        parts |= {"liquid": before, "mouth": Chamber(volume=VOLUME, pressure=AMBIENT)}
        room.append("liquid.a")
        mouth = ["liquid.b", "mouth.fluid"]
        joints.append(mouth)
    for name, part in passages.items():
        mouth.append(f"{name}.a")
        tank.append(f"{name}.b")
        if isinstance(part, Annulus):
            joints.append([f"{name}.needle", "ground"])
    return Network(parts, [*joints, room, tank], fluid=fluid).rows()


def swing(rows, duration=7e-3):
    return simulate_network(
        rows, duration=duration, step=0.1e-6, coarse=1, record=1e-6, start="free"
    )


def added_mass(result, more=0.0):
    """From the time of whole periods, less the mass of the body.

    ``more`` is what another piston adds to the stiffness, over it.
    """
    y = result.channels["mass.body displacement"].values + PUSH / STIFFNESS / (1.0 + more)
    i = np.flatnonzero((y[:-1] > 0.0) & (y[1:] <= 0.0))
    times = result.time[i] + np.diff(result.time)[i] * y[i] / (y[i] - y[i + 1])
    omega = 2.0 * pi * (len(times) - 1) / (times[-1] - times[0])
    return STIFFNESS * (1.0 + more) / omega**2 - MASS


def notes(passages, pace=5e3, speed=0.05, **more):
    """Notes on a motion of that pace [rad/s] and greatest speed."""
    return notes_on(network(passages, **more), pace, speed)


def notes_on(rows, pace=5e3, speed=0.05, pressure=AMBIENT):
    record = 1e-3 / pace
    time = record * np.arange(int(2.0 * pi / pace / record))
    moved = {"mass velocity": ChannelData(unit="m/s", values=speed * np.cos(pace * time))}
    moved["room pressure"] = ChannelData(unit="Pa", values=np.full(len(time), pressure))
    return list(liquid_doubts(rows, moved, record))


def stated(note):
    """Added mass of a note [kg]."""
    return parse_quantity(re.split(" on its| at '", note.split("act like ")[1])[0], MASSES)


def test_column_swings_as_an_added_mass() -> None:
    length, bore = 5e-3, 2e-3
    column = Inertance(length=length, diameter=bore, friction="none")
    inertance = RHO * length / (pi / 4.0 * bore**2)
    found = swing(network({"column": column}))
    # stiff liquid: sqrt(k/(m + m_eq)); its compliance as exactly: m and m_eq with a spring between
    spring = BULK * AREA**2 / VOLUME
    pair = np.array([[STIFFNESS + spring, -spring], [-spring, spring]])
    weights = np.array([MASS, inertance * AREA**2])
    omega = sqrt(np.linalg.eigvals(pair / weights[:, None]).real.min())
    exact = STIFFNESS / omega**2 - MASS
    assert exact == pytest.approx(inertance * AREA**2, rel=1e-3, abs=0.0)
    # found 4e-5: the other mode, at 0.07 % of the amplitude, shifts the times of the periods
    assert added_mass(found) == pytest.approx(exact, rel=2e-4, abs=0.0)


@pytest.mark.parametrize("name", ["gap", "hole"])
def test_mass_of_the_note_is_what_its_inertance_adds(name) -> None:
    part = {"gap": GAP, "hole": HOLE}[name]
    with pytest.warns(UserWarning, match="inertia is left out") as warned:
        bare = swing(network({name: part}))
    note = next(str(w.message) for w in warned if "displaces" in str(w.message))
    length, area = (float(note.split(f"{key}: ")[1].split(" mm")[0]) for key in ("length", "area"))
    column = Inertance(length=1e-3 * length, area=1e-6 * area, friction="none")
    whole = swing(network({name: part}, before=column))
    # two digits of the note, 1 %; the compliance of both rooms, 1 %
    assert added_mass(whole) - added_mass(bare) == pytest.approx(stated(note), rel=0.02, abs=0.0)


def test_passages_share_what_is_displaced() -> None:
    (note,) = notes({"gap": GAP, "hole": HOLE}, speed=1e-4)  # no loss, little friction
    gap = RHO * GAP.length / (pi * GAP.diameter * GAP.clearance)
    hole = RHO / HOLE.diameter  # Rayleigh
    assert stated(note) == pytest.approx(AREA**2 / (1.0 / gap + 1.0 / hole), rel=0.02, abs=0.0)
    assert "through 'gap' and 'hole'" in note
    assert "join gap.a and hole.a to a chamber of their own" in note
    area = 1e6 * RHO * GAP.length * (1.0 / gap + 1.0 / hole)  # one column with both inertances
    assert f"'room' by {{type: inertance, length: 5 mm, area: {area:.3g} mm^2}}" in note


def test_no_note_where_the_liquid_does_not_matter() -> None:
    column = Inertance(length=5e-3, area=2e-6)
    assert notes({"gap": GAP}) != []
    assert notes({"gap": GAP}, before=column) == []  # it has its inertia
    assert notes({"gap": GAP}, before=column.model_copy(update={"area": 8e-6})) != []  # too little
    assert notes({"gap": GAP}, volume=1e-3) == []  # the chamber takes it
    assert notes({"gap": GAP}, pace=2e6) == []  # before the column answers
    assert notes({"hole": Orifice(diameter=4e-3)}) == []  # 3 % of the mass
    tight = Annulus(diameter=5e-3, length=10e-3, clearance=4e-6)
    locked = sqrt(BULK * AREA**2 / VOLUME / MASS)  # pace of the mass on the closed chamber
    assert notes({"guide": tight}, pace=locked) == []  # squeezed, it does not pass
    (note,) = notes({"gap": GAP, "guide": tight})
    assert "'guide'" not in note
    assert notes({"gap": GAP}, speed=0.0) == []


def test_many_passages_in_a_row_name_one() -> None:
    """Each holds less than a tenth of what is missing."""
    count = 20
    parts = {
        "mass": RigidMass(mass=MASS),
        "spring": Spring(stiffness=STIFFNESS, preload=PUSH),
        "face": PressureFace(direction="opening", outer_diameter=FACE),
        "tank": PressureSource(pressure=AMBIENT),
        **{f"room{i}": Chamber(volume=0.1 * VOLUME, pressure=AMBIENT) for i in range(count)},
        **{f"hole{i}": HOLE for i in range(count)},
    }
    joints = [["mass.body", "spring.end", "face.body"]]
    joints += [
        [f"hole{i - 1}.b" if i else "face.fluid", f"room{i}.fluid", f"hole{i}.a"]
        for i in range(count)
    ]
    rows = Network(parts, [*joints, [f"hole{count - 1}.b", "tank.fluid"]], fluid=HEPTANE).rows()
    (note,) = notes_on(rows, speed=1e-4)
    assert re.search(r"through 'hole\d+'.*, whose inertia", note)
    assert "Try: join hole" in note


SECOND, FURTHER = 0.1e-3, 4e-3  # mass of another piston, diameter of its face


def pistons(before=None):
    """Two masses on springs: what one displaces passes a hole and drives the other."""
    joints = [["mass.body", "spring.end", "face.body"], ["other.body", "back.end", "far.body"]]
    near = ["room.fluid", "face.fluid"]
    parts = {
        "mass": RigidMass(mass=MASS),
        "spring": Spring(stiffness=STIFFNESS, preload=PUSH),
        "face": PressureFace(direction="opening", outer_diameter=FACE),
        "room": Chamber(volume=0.1 * VOLUME, pressure=AMBIENT),
        "hole": HOLE,
        "end": Chamber(volume=0.1 * VOLUME, pressure=AMBIENT),
        "far": PressureFace(direction="opening", outer_diameter=FURTHER),
        "other": RigidMass(mass=SECOND),
        "back": Spring(stiffness=STIFFNESS, preload=0.0),
    }
    if before is not None:
        parts |= {"liquid": before, "mouth": Chamber(volume=0.1 * VOLUME, pressure=AMBIENT)}
        joints.append([*near, "liquid.a"])
        near = ["liquid.b", "mouth.fluid"]
    joints += [[*near, "hole.a"], ["hole.b", "end.fluid", "far.fluid"]]
    return Network(parts, joints, fluid=HEPTANE).rows()


def test_two_pistons_share_the_liquid_between_them() -> None:
    """One note on both: Rayleigh's rho/d on m + (A/A')^2 m', and what its inertance adds to them.

    Two digits of the note, and the compliance of three rooms: 2 %.
    """
    with pytest.warns(UserWarning, match="inertia is left out") as warned:
        bare = swing(pistons())
    (note,) = [str(w.message) for w in warned if "displace" in str(w.message)]
    ratio = (FACE / FURTHER) ** 2
    assert note.startswith("'mass' and 'other' displace liquid through 'hole'")
    assert stated(note) == pytest.approx(RHO / HOLE.diameter * AREA**2, rel=0.05, abs=0.0)
    assert f"where {1e3 * (MASS + ratio**2 * SECOND):.3g} g move" in note
    length, area = (float(note.split(f"{key}: ")[1].split(" mm")[0]) for key in ("length", "area"))
    whole = swing(pistons(Inertance(length=1e-3 * length, area=1e-6 * area, friction="none")))
    found = added_mass(whole, ratio**2) - added_mass(bare, ratio**2)
    assert found == pytest.approx(stated(note), rel=0.02, abs=0.0)


def test_a_long_hole_holds_what_it_is_long() -> None:
    long = HOLE.model_copy(update={"length": 5e-3})
    (note,), (thin,) = notes({"hole": long}, speed=1e-4), notes({"hole": HOLE}, speed=1e-4)
    added = RHO * 5e-3 / HOLE.hole_area * AREA**2
    assert stated(note) - stated(thin) == pytest.approx(added, rel=0.03, abs=0.0)  # two digits
    assert "thin plate" in thin
    assert "thin plate" not in note


def test_a_body_that_trembles_has_no_note() -> None:
    """1 nm on a stop, or a hundredth of what another body travels."""
    assert notes({"gap": GAP}, speed=1e-6) == []
    assert notes({"gap": GAP}, speed=1e-4) != []


def test_a_note_is_told_once_for_all_variants() -> None:
    first, second = notes({"gap": GAP}), notes({"gap": GAP}, speed=0.1)
    found = list(told_once(["one", *first, "two", *second, "two"]))
    assert found == ["one", *first, "two", "two"]


def test_a_body_on_its_machine_displaces_as_a_free_one() -> None:
    """It has a momentum instead of rigid modes (a mount of 1 Hz)."""
    rows = network({"gap": GAP})
    (row,) = rows.bodies
    held = replace(
        row.body,
        rigid_count=0,
        rigid_axial=np.zeros(0),
        omega=np.array([2.0 * pi]),
        momentum=row.body.rigid_axial,
    )
    free = notes_on(rows)
    assert free != []
    rows.bodies[0] = replace(row, body=held)
    assert notes_on(rows) == free


def test_gas_in_the_liquid_counts_as_it_is_while_the_body_moves() -> None:
    """Bubbles at the start take what is displaced; pressed small, as most of a run, they do not."""
    fluid = library_fluid("n-heptane").at(293.15, gas_fraction=0.005)
    assert fluid.bulk_modulus(AMBIENT) < 0.05 * fluid.bulk_modulus(100 * AMBIENT)
    rows = network({"gap": GAP}, volume=100 * VOLUME, fluid=fluid)
    assert notes_on(rows) == []
    assert notes_on(rows, pressure=100 * AMBIENT) != []
