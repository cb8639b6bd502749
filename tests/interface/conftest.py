"""A made-up impact study of realistic size: half sines of 250 N and 15 us, two levels.

Nothing in it was computed by a solver; it only has the shape, the size and the spread of the real
thing, so that reports and stores can be tested alone.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from browser_pages import chromium, launched
from json_schema_check import every_result_is_documented  # noqa: F401

from klack.acoustics.comparison import compare_histories
from klack.analyses.impact.record import (
    ContactSummary,
    ImpactStudy,
    LawSummary,
    LevelResult,
    ModalEnergy,
    SectionPicture,
)
from klack.analyses.impact.section import section_picture
from klack.assembling.body_summary import BodySummary
from klack.bodies.reduction.transfer import TransferComparison
from klack.contact.history import BodyEnergy, EnergyLedger, ImpactHistory
from klack.contact.restitution import measure_impact
from klack.mesh.mesh import ElementBlock, Mesh

MASS, SPEED = 2.96e-3, 0.5


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium without a display, which draws three dimensions by software."""
    sync_api = pytest.importorskip("playwright.sync_api")
    if chromium() is None:
        pytest.skip("no chromium here")
    with sync_api.sync_playwright() as library:
        started = launched(library)
        yield started
        started.close()


def half_sine(peak: float, duration: float, ripple: float, touch: float) -> ImpactHistory:
    step = 50e-9
    t = (np.arange(1200) + 0.5) * step - touch
    inside = (t > 0) & (t < duration)
    force = np.where(inside, peak * np.sin(np.pi * t / duration), 0.0)
    force *= 1 + ripple * np.sin(2 * np.pi * 180e3 * t)
    velocity = -SPEED + np.concatenate([[0.0], np.cumsum(force) * step / MASS])
    initial = 0.5 * MASS * SPEED**2
    rigid = 0.5 * MASS * velocity[-1] ** 2
    bodies = (
        BodyEnergy(name="needle", translation=rigid, vibration=0.1 * initial, strain=1e-5),
        BodyEnergy(name="housing", translation=0.0, vibration=0.9 * initial - rigid, strain=1e-5),
    )
    return ImpactHistory(
        step=step,
        force=force,
        gap=np.where(inside, -1e-9 * force, 1e-7 + 0.3 * np.maximum(t, 0)),
        velocity_a=velocity,
        velocity_b=np.zeros(len(velocity)),
        speed=SPEED,
        mass_a=MASS,
        mass_b=np.inf,
        ledger=EnergyLedger(initial=initial, bodies=bodies),
        solver="made up",
    )


def level(name: str, label: str, history: ImpactHistory, **numbers: float) -> LevelResult:
    frequency = np.array([31e3, 62e3, 95e3, 130e3, 166e3, 205e3, 248e3])
    energy = history.ledger.initial * 0.04 / np.arange(1, 8) ** 2
    parts = history.ledger.parts()
    return LevelResult(
        level=name,
        label=label,
        history=history,
        measures=measure_impact(history),
        degrees_of_freedom=int(numbers["dofs"]),
        steps=1200,
        step=history.step,
        wall_time=numbers["wall_time"],
        setup_time=numbers["setup_time"],
        energies={key: value for key, value in parts.items() if value},
        energy_residual=numbers["residual"],
        modal_energy=()
        if name == "full"
        else (
            ModalEnergy(body="needle", frequency=frequency, energy=energy),
            ModalEnergy(body="housing", frequency=0.7 * frequency, energy=1.7 * energy),
        ),
    )


def slab(radius: float, low: float, high: float, columns: int, rows: int) -> Mesh:
    """Axisymmetric six-node triangles on a rectangle in (r, z)."""
    r, z = np.linspace(0, radius, 2 * columns + 1), np.linspace(low, high, 2 * rows + 1)
    points = np.stack(np.meshgrid(r, z, indexing="ij"), axis=-1).reshape(-1, 2)
    i, j = np.meshgrid(2 * np.arange(columns), 2 * np.arange(rows), indexing="ij")

    def node(a: int, b: int) -> np.ndarray:
        return ((i + a) * len(z) + j + b).ravel()

    corners = [[(0, 0), (2, 0), (2, 2), (1, 0), (2, 1), (1, 1)]]
    corners += [[(0, 0), (2, 2), (0, 2), (1, 1), (1, 2), (0, 1)]]
    elements = [np.column_stack([node(a, b) for a, b in pattern]) for pattern in corners]
    return Mesh(points=points, blocks=(ElementBlock("tri6", np.concatenate(elements), "steel"),))


def pictures() -> tuple[SectionPicture, SectionPicture]:
    needle, housing = slab(2e-3, 0.0, 12e-3, 8, 30), slab(5e-3, -4e-3, 0.0, 16, 14)
    u = np.zeros((needle.node_count, 2))
    u[:, 1] = -3.2e-6 + 0.8e-6 * np.exp(-needle.points[:, 1] / 3e-3)
    v = np.zeros((housing.node_count, 2))
    distance = np.hypot(housing.points[:, 0], housing.points[:, 1])
    v[:, 1] = -2.4e-6 * np.exp(-distance / 2e-3) * (housing.points[:, 1] + 4e-3) / 4e-3
    return (
        section_picture(needle, u.ravel(), 7.4e-6, "needle"),
        section_picture(housing, v.ravel(), 7.4e-6, "housing"),
    )


def receptances(body: str) -> TransferComparison:
    frequencies = np.geomspace(2e3, 300e3, 900)
    w2, omega2 = (2 * np.pi * frequencies) ** 2, (2 * np.pi * 31e3 * np.arange(1, 60)) ** 2
    terms = 1.5e7 / (np.arange(1, 60) ** 0.2) * 1.0
    modes = terms[:, None] / (omega2[:, None] * (1 + 0.01j) - w2)
    full = modes.sum(axis=0) * 1e-5
    static = (terms / omega2)[:, None] * np.ones_like(frequencies) * 1e-5
    curves = [full]
    for kept in (20, 50):
        cut = modes[:kept].sum(axis=0) * 1e-5
        curves += [cut, cut + static[kept:].sum(axis=0)]
    values = np.array(curves)
    levels = 20 * np.log10(np.abs(values / values[0]))
    return TransferComparison(
        body=body,
        port="tip" if body == "needle" else "seat",
        frequencies=frequencies,
        labels=(
            "full",
            "20 modes",
            "20 modes + static correction",
            "50 modes",
            "50 modes + static correction",
        ),
        curves=values,
        level_deviations=levels,
        mean_deviations=np.abs(levels),
        tolerance=1.0,
        valid_up_to=np.array([300e3, 2e3, 180e3, 2e3, 300e3]),
        loss_factor=0.01,
        reference_note="made up",
    )


@pytest.fixture(scope="session")
def impact_study() -> ImpactStudy:
    full = level(
        "full",
        "full order, point-by-point contact",
        half_sine(250.0, 15e-6, 0.0, 0.50e-6),
        dofs=31_482,
        wall_time=41.3,
        setup_time=12.0,
        residual=-3.1e-5,
    )
    reduced = level(
        "reduced",
        "reduced, 20 + 40 modes, consistent law",
        half_sine(251.0, 14.9e-6, 0.002, 0.61e-6),
        dofs=61,
        wall_time=0.72e-3,
        setup_time=21.5,
        residual=3.4e-13,
    )
    force = np.linspace(0, 300, 31)
    return ImpactStudy(
        case="demo",
        title="Needle on a conical seat",
        description="A spherical needle tip meets a conical seat at half a metre per second.",
        case_text="speed: 0.5 m/s\nbodies:\n  needle: {mass: 2.96 g}\n",
        speed=SPEED,
        gap=0.0,
        version="0.1.0",
        versions={"numpy": "2.0", "scipy": "1.14"},
        created="2025-01-31T12:00:00+00:00",
        wall_time=78.0,
        stage_times={"mesh": 3.1, "assembly": 1.2, "eigenmodes": 8.0, "full-order run": 41.3},
        bodies=(
            BodySummary(
                name="needle",
                model="axisymmetric",
                source="revolved profile in the case file",
                support="free",
                material="steel: E = 210 GPa, nu = 0.3, rho = 7850 kg/m^3",
                mass=MASS,
                nodes=7021,
                elements=3400,
                dofs=14042,
                frequencies=31e3 * np.arange(1, 21),
                compliance_share=0.65,
            ),
            BodySummary(
                name="housing",
                model="axisymmetric",
                source="revolved profile in the case file",
                support="held at 'flange'",
                material="steel: E = 210 GPa, nu = 0.3, rho = 7850 kg/m^3",
                mass=31e-3,
                nodes=8720,
                elements=4250,
                dofs=17440,
                frequencies=22e3 * np.arange(1, 41),
                compliance_share=0.34,
            ),
        ),
        contact=ContactSummary(
            surfaces="needle.tip on housing.seat",
            points=64,
            half_width=35e-6,
            size_ratio=0.4,
            approach=3.6e-6 * (force / 250) ** 0.9,
            force=force,
            area=2e-7 * (force / 250) ** 0.5,
        ),
        law=LawSummary(
            kind="consistent",
            indentation=1.5e-6 * (force / 250) ** 0.8,
            force=force,
            share=0.35 + 0.1 * np.exp(-force / 40),
            linear_stiffness=1.7e8,
            fit_range=(20.0, 255.0),
            classical_stiffness=1.1e9,
            classical_size=0.4e-3,
        ),
        levels={"full": full, "reduced": reduced},
        reference="full",
        deviations={
            "reduced": compare_histories(full.history, reduced.history),
        },
        transfer=(receptances("needle"), receptances("housing")),
        sections=pictures(),
        warnings=("the contact of the made-up study is coarse",),
    )


@pytest.fixture(scope="session")
def lonely_study(impact_study: ImpactStudy) -> ImpactStudy:
    """One level, nothing to compare, no transfer functions, no pictures."""
    return replace(
        impact_study,
        levels={"reduced": impact_study.levels["reduced"]},
        reference="reduced",
        deviations={},
        transfer=(),
        sections=(),
        warnings=(),
    )
