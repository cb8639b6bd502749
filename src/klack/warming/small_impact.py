"""Smallest impacts with real types, without a mesh."""

from dataclasses import replace
from math import inf

import numpy as np

from klack.contact.asperity_layer import AsperityLayer
from klack.contact.friction import Friction
from klack.contact.laws import HertzLaw
from klack.contact.pressure_limit import PressureLimit
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.simulation.impact import simulate_impact
from klack.simulation.system import ContactPair, ReducedSystem
from klack.transient.interface_arrays import Guide
from klack.transient.interface_model import InterfaceModel, StaticChecks
from klack.transient.interface_run import simulate_interface

__all__ = ["featured_impacts", "plain_impacts"]

_LINES = np.array([0.0, 1e-6])


def plain_impacts() -> None:
    """Impacts at both levels: on the axis, elastic, smooth, without friction."""
    bodies = rigid_mass_body("needle", 2e-3), fixed_body("seat")
    pair = ContactPair(
        body_a="needle",
        port_a="contact",
        body_b="seat",
        port_b="contact",
        law=HertzLaw(1e10),
        gap=1e-6,
    )
    simulate_impact(ReducedSystem(bodies=bodies, contacts=(pair,)), speed=0.1, duration=1e-6)
    _touch(_model())


def featured_impacts() -> None:
    """Impact at the interface level with every feature of contacts, and a guide."""
    plain, limit = _model(), np.array([1e8, 2e8])
    _touch(plain, guide=_guide())
    _touch(replace(plain, limit=PressureLimit(set=_LINES, pressure=limit)))
    _touch(replace(plain, layer=AsperityLayer(closure=_LINES, pressure=limit - 1e8)))
    sideways = replace(
        plain,
        compliance=np.diag(np.full(4, 1e-9)),
        tangents=np.eye(2),
        axial_across=np.zeros(2),
        friction=(Friction.coulomb(0.1),),
    )
    _touch(sideways)
    _touch(sideways, guide=_guide())


def _touch(model: InterfaceModel, guide: Guide | None = None) -> None:
    simulate_interface(model, speed=0.1, duration=1e-7, step=1e-8, guide=guide)


def _model() -> InterfaceModel:
    """Two points below a rigid mass that moves along and across the axis."""
    traces = np.array([[1.0, 0.0], [1.0, 0.0]])
    rigid = np.zeros((6, 2))
    rigid[2, 0] = rigid[0, 1] = 1.0
    return InterfaceModel(
        bodies=("needle", "seat"),
        masses=(1.0, inf),
        omega=np.zeros(2),
        damping=np.zeros(2),
        owner=np.zeros(2, dtype=np.int64),
        traces=traces,
        compliance=np.diag(np.full(2, 1e-9)),
        gap=np.zeros(2),
        axial=np.ones(2),
        area=np.ones(2),
        points=np.zeros((2, 2)),
        contacts=(("contact", 0, 2),),
        rim=np.zeros(2, dtype=bool),
        beyond=np.full(2, inf),
        rigid=rigid,
        drift=np.vstack([rigid[2], np.zeros(2)]),
        centre=np.zeros(3),
        longest_period=0.0,
        checks=StaticChecks(lowest_pivot=1.0, reciprocity=0.0, static_limit=0.0, modal_share=0.0),
    )


def _guide() -> Guide:
    """A height of the shaft, near the axis."""
    one, across = np.ones(1), np.zeros((1, 2, 2))
    across[0, 0, 1] = 1.0
    return Guide(
        heights=one,
        clearance=one,
        offset=np.zeros((1, 2)),
        traces=across,
        slide=np.array([[1.0, 0.0]]),
        turn=np.zeros((1, 3, 2)),
        radius=one,
        compliance=1e-9 * np.eye(2)[None],
        friction=0.1 * one,
        viscous=np.zeros(1),
    )
