"""Truth: a result and a case of an earlier version, whose mass flows were called flow."""

from dataclasses import replace

import numpy as np
import pytest

from klack.analyses.stroke.analysis import STROKE
from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import load_valve_case
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.inertance import Inertance
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_source import PressureSource
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.network.rows import Ambient
from klack.simulation.flow_channels import with_present_names
from klack.simulation.network_run import simulate_network


@pytest.fixture(scope="module")
def channels():
    parts = {
        "needle": RigidMass(mass=1e-3),
        "spring": Spring(stiffness=1e4, preload=0.0),
        "rail": PressureSource(pressure=5e6),
        "neck": Inertance(length=5e-3, diameter=1e-3),
        "room": Chamber(volume=1e-6, pressure=1e6),
        "drain": Orifice(diameter=0.5e-3),
    }
    joints = [
        ["needle.body", "spring.end"],
        ["rail.fluid", "neck.a"],
        ["neck.b", "room.fluid", "drain.a"],
        ["drain.b", "ambient"],
    ]
    rows = Network(parts, joints, Ambient(), library_fluid("n-heptane").at(293.15)).rows()
    return simulate_network(rows, duration=1e-5, step=1e-7, record=1e-6, start="free").channels


def test_every_restriction_has_a_mass_flow_and_no_other_name(channels):
    flows = {name for name, data in channels.items() if data.unit == "kg/s"}

    assert flows == {"neck mass flow", "neck mean mass flow", "drain mass flow"}


def test_channels_of_earlier_versions_take_the_names_of_today(channels):
    former = {"neck mean mass flow": "neck flow", "drain mass flow": "drain flow"}
    old = {former.get(name, name): data for name, data in channels.items()}
    new = with_present_names(old)

    assert list(new) == list(channels)
    assert all(new[name] is data for name, data in channels.items())
    assert with_present_names(new) == new


def test_a_stored_stroke_of_earlier_versions_is_read_with_names_of_today(tmp_path, channels):
    case = tmp_path / "case.yaml"
    case.write_text(CASE)
    study = run_stroke(load_valve_case(case))
    variant = study.variants["wet"]
    assert study.channels.flows == ("drain mass flow",)
    old = {name.replace("mass flow", "flow"): c for name, c in variant.result.channels.items()}
    earlier = replace(
        study,
        variants={"wet": replace(variant, result=replace(variant.result, channels=old))},
        channels=replace(study.channels, flows=("drain flow",)),
    )
    STROKE.save(earlier, tmp_path / "old")
    read = STROKE.load(tmp_path / "old")

    assert read.channels.flows == ("drain mass flow",)
    found = read.variants["wet"].result.channels
    assert set(found) == set(variant.result.channels)
    now = variant.result.channels["drain mass flow"].values
    assert np.array_equal(found["drain mass flow"].values, now)


CASE = """
klack: 1
title: A chamber with a sensor on its outflow
network:
  fluid: n-heptane
  components:
    needle: {type: rigid-mass, mass: 1 g, points: [tip]}
    seat: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.5}
    spring: {type: spring, stiffness: 10 N/mm, preload: 1 N}
    room: {type: chamber, volume: 1 cm^3, pressure: 10 bar}
    drain: {type: orifice, diameter: 0.5 mm}
    pusher:
      type: controlled-force
      sample_time: 10 us
      sensors: {leaving: {channel: drain flow, unit: g/s}}
      controller: {kind: pid, sensor: leaving, setpoint: 0, gain: 0.1, lower: -1, upper: 1}
  connections:
    - [needle.tip, seat.upper, spring.end, pusher.end]
    - [seat.lower, ground]
    - [room.fluid, drain.a]
    - [drain.b, ambient]
run: {duration: 0.1 ms, variants: [wet]}
"""
