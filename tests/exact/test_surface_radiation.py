"""Outside of held bodies and its radiation over frequency: sphere, cups, what is open."""

from dataclasses import replace
from itertools import pairwise
from math import pi
from types import SimpleNamespace

import numpy as np
import pytest
from boundary_box import box
from scipy.integrate import simpson
from scipy.special import eval_legendre, spherical_jn, spherical_yn

from klack.acoustics.boundary.outline import REST, revolved_outline
from klack.acoustics.boundary.over_frequency import ANGLES, SurfaceRadiation, surface_radiation
from klack.acoustics.boundary.solid_outline import solid_outline
from klack.acoustics.boundary.solution import radiation
from klack.acoustics.plate import Air
from klack.acoustics.radiation import radiation_loss
from klack.analyses.noise.run import _radiation_notes
from klack.bodies.reduction.structure import Structure
from klack.errors import InputError
from klack.verification.radiation import sphere_efficiency
from klack.verification.vibration import oscillator

C = 343.2
SIZE = C / 20e3 / 6.0


def structure(name: str, ways: dict[str, np.ndarray], shapes=lambda r, z: np.ones((len(r), 1))):
    """Body of revolution by its named surfaces (k, 2) and normal fields on its faces."""
    a = np.concatenate([way[:-1] for way in ways.values()])
    b = np.concatenate([way[1:] for way in ways.values()])
    d, middle = b - a, (a + b) / 2.0
    length = np.hypot(*d.T)
    fields = shapes(*middle.T)
    m, count = fields.shape[1], len(a)
    groups = np.repeat(np.arange(len(ways)), [len(way) - 1 for way in ways.values()])
    area = 2.0 * pi * middle[:, 0] * length
    nothing = np.zeros
    return Structure(
        name=name, mass=0.05, dimension=2, omega=np.full(m, 1e5), damping=np.full(m, 0.01),
        port_names=("port",), port_stops=("",), port_signs=np.ones(1), port_shapes=nothing((m, 1)),
        static_compliance=nothing((1, 1)), participation=nothing(m), group_names=tuple(ways),
        group_area=np.bincount(groups, area), group_gram=nothing((len(ways), m + 2, m + 2)),
        group_volume=nothing((len(ways), m + 2)), points=np.concatenate([a, b]),
        faces=np.column_stack([np.arange(count), count + np.arange(count)]), face_group=groups,
        face_area=area, face_shapes=fields.astype(np.float32),
        face_residual=nothing((count, 1), dtype=np.float32), axial_normals=-d[:, 0] / length,
    )  # fmt: skip


def line(*corners: tuple[float, float], size: float = 0.5e-3) -> np.ndarray:
    """Points along straight lines."""
    found = [np.array(corners[:1])]
    for one, other in pairwise(corners):
        step = np.subtract(other, one)
        count = max(1, round(float(np.hypot(*step)) / size))
        found.append(one + step * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(found)


def cup(name: str = "cup", *, top: bool = True) -> Structure:
    """Cylinder of 10 mm with a bore of 4 mm from above, its bottom, side, top and bore named."""
    ways = {
        "bottom": line((0.0, 0.0), (0.01, 0.0)),
        "side": line((0.01, 0.0), (0.01, 0.03)),
        "top": line((0.01, 0.03), (0.004, 0.03)),
        "bore": line((0.004, 0.03), (0.004, 0.01), (0.0, 0.01)),
    }
    return structure(name, ways if top else {k: ways[k] for k in ("bottom", "side", "bore")})


@pytest.fixture(scope="module")
def sphere() -> tuple[Structure, SurfaceRadiation]:
    angle = np.linspace(pi, 0.0, 181)
    way = 0.02 * np.column_stack([np.abs(np.sin(angle)), np.cos(angle)])
    own = structure(
        "ball",
        {"skin": way},
        lambda r, z: np.column_stack([eval_legendre(n, z / np.hypot(r, z)) for n in (0, 2, 3)]),
    )
    (found,) = surface_radiation([own], C)
    return own, found


def test_sphere_at_frequencies_between_those_solved(sphere) -> None:
    """Interpolation 0.03 dB, elements 0.03 dB; from far below ka 0.1 to the top."""
    _, found = sphere
    area, f = 4.0 * pi * 0.02**2, np.geomspace(15.0, 19e3, 40)
    for column, n in ((0, 0), (-1, 1), (1, 2)):
        unit = np.zeros((f.size, found.scale.shape[1]), dtype=complex)
        unit[:, column] = 1.0
        power = found.power(f, unit).sum(axis=0)
        ka = 2.0 * pi * f / C * 0.02
        known = [area / (2 * n + 1) * sphere_efficiency(n, x) for x in ka]
        heard = ka > (0.6 if n == 2 else 0.0)  # P_2 below: the volume flow of its elements is left
        error = 10.0 * np.log10(power / known)[heard]
        assert np.abs(error).max() < (0.1 if n < 2 else 0.3)


def test_sound_damps_modes_by_its_power_over_their_energy(sphere) -> None:
    """A breathing sphere, and one mass whose face radiates plane waves: ``rho c sigma S / w m``."""
    own, found = sphere
    air = Air(density=1.2, sound_speed=C)
    breathing = replace(own, omega=np.full_like(own.omega, 2.0 * pi * 9e3))
    loss = radiation_loss(breathing, found, air)
    area, ka = 4.0 * pi * 0.02**2, 2.0 * pi * 9e3 / C * 0.02
    known = air.impedance * area * sphere_efficiency(0, ka) / (2.0 * pi * 9e3)
    assert loss[0] == pytest.approx(known, rel=0.02)
    mass = oscillator(mass=1e-3, stiffness=1e7, base=1.0)
    plane = float(radiation_loss(mass, "unity", air)[0])
    assert plane == pytest.approx(air.impedance * 1e-4 / (1e-3 * 1e5), rel=1e-12)
    around = SimpleNamespace(radiation_of=lambda own: "unity", air=air)
    heavy, light = (replace(mass, damping=np.array([zeta])) for zeta in (0.01, 0.001))
    assert not list(_radiation_notes(SimpleNamespace(structures=[heavy]), around))
    (note,) = _radiation_notes(SimpleNamespace(structures=[light]), around)
    assert f"Sound radiation dissipates {100 * plane / 0.002:.2g} %" in note


def test_motions_that_cross_do_not_radiate_together(sphere) -> None:
    """P_0 and P_2: power of the sum is the sum of powers."""
    _, found = sphere
    f = np.array([9e3])
    unit = np.eye(found.scale.shape[1], dtype=complex)
    one, two = (found.power(f, unit[[i]]).sum() for i in (0, 1))
    both = found.power(f, (unit[0] + 1j * unit[1])[None]).sum()
    assert both == pytest.approx(one + two, rel=1e-9)
    assert found.power(f, (unit[0] + unit[1])[None]).sum() == pytest.approx(one + two, rel=2e-3)


def test_energy_is_the_integral_of_power(sphere) -> None:
    _, found = sphere
    rng = np.random.default_rng(4)
    f = np.linspace(400.0, 30e3, 300)
    fields = rng.normal(size=(300, 5)) + 1j * rng.normal(size=(300, 5))
    weights = rng.uniform(size=(2, 300))
    energy = found.energy(f, fields, weights)
    assert energy == pytest.approx(2.0 * found.power(f, fields) @ weights.T, rel=1e-9)
    assert np.all(found.power(f, fields).sum(axis=0) > 0.0)


def test_outside_of_a_cup_is_closed_over_its_bore() -> None:
    own = cup()
    outline = revolved_outline([own], SIZE)
    mesh = outline.mesh
    assert mesh.volume == pytest.approx(pi * 0.01**2 * 0.03, rel=1e-12)
    assert outline.groups == ("cup.bottom", "cup.side", "cup.top", "cup.bore", REST)
    assert set(outline.group) == {0, 1, 2, 4}
    assert outline.covered == pytest.approx(0.004**2 / (2 * 0.01**2 + 2 * 0.01 * 0.03), rel=1e-9)
    assert outline.largest < 1.6 * 0.01 / 12
    modal, whole = outline.motions[0][:, 0], outline.motions[0][:, -1]
    # the cover moves as the face beside it; as a whole the body pushes no air out
    assert modal == pytest.approx(1.0)
    assert abs(mesh.areas @ whole) < 1e-15
    assert whole == pytest.approx(mesh.normals[:, 1])


def test_bodies_close_each_other() -> None:
    """A plug in the bore, higher than the rim: one outside, each body with its own motion on it."""
    way = {"side": line((0.003, 0.02), (0.003, 0.034)), "top": line((0.003, 0.034), (0.0, 0.034))}
    plug = structure("plug", way)
    outline = revolved_outline([cup(), plug], SIZE)
    assert outline.mesh.volume == pytest.approx(
        pi * (0.01**2 * 0.03 + 0.003**2 * 0.004), rel=2e-2
    )  # a straight line from rim to plug
    names = [outline.groups[i] for i in dict.fromkeys(outline.group.tolist())]
    assert names[:3] == ["cup.bottom", "cup.side", "cup.top"]
    assert names[-1] == "plug.top"
    cups, plugs = outline.motions
    on_plug = np.array([outline.groups[i].startswith("plug") for i in outline.group])
    assert np.all(cups[on_plug, 0] == 0.0)
    assert np.all(plugs[~on_plug & (plugs[:, 0] != 0), 0] <= 1)
    assert cups[:, -1] == pytest.approx(plugs[:, -1])


def test_without_its_top_a_cup_is_closed_by_a_cover() -> None:
    """As with a mounting face that has no name among the radiating surfaces."""
    outline = revolved_outline([cup(top=False)], SIZE)
    assert outline.mesh.volume == pytest.approx(pi * 0.01**2 * 0.03, rel=1e-9)
    covers = outline.group == len(outline.groups) - 1
    assert np.all(outline.motions[0][covers, 0] == 0.0)  # nothing beside faces the same way


def test_a_disc_encloses_nothing() -> None:
    disc = structure("disc", {"top": line((0.01, 0.0), (0.0, 0.0))})
    with pytest.raises(InputError, match=r"enclose nothing(.|\n)*noise\.surfaces"):
        revolved_outline([disc], SIZE)


def test_large_bodies_hold_up_to_a_lower_frequency() -> None:
    far = structure("long", {"all": line((0, 0), (0.1, 0), (0.1, 1.2), (0, 1.2), size=5e-3)})
    outline = revolved_outline([far], SIZE)
    assert len(outline.group) < 220
    assert outline.largest > 1.5 * SIZE


def block(size: float, *, top: bool = True) -> Structure:
    """Box of 10 x 10 x 15 mm in triangles, with one field that is 1 on its bottom."""
    mesh = box(size)
    upwards = mesh.normals[:, 2]
    kept = np.flatnonzero((upwards < 0.5) | top)
    group = np.where(upwards[kept] < -0.5, 0, 1)
    points, faces = 0.01 * mesh.points, mesh.corners[kept]
    flat = structure("block", {"bottom": line((0.0, 0.0), (1.0, 0.0), size=1.0)})
    nothing = np.zeros((2, 3, 3))
    return replace(
        flat, dimension=3, points=points, faces=faces, face_group=group,
        face_area=1e-4 * mesh.areas[kept], axial_normals=upwards[kept],
        face_shapes=(group == 0)[:, None].astype(np.float32), group_names=("bottom", "sides"),
        face_residual=np.zeros((len(kept), 1), dtype=np.float32), group_gram=nothing,
        group_area=1e-4 * np.bincount(group, mesh.areas[kept]), group_volume=nothing[0],
    )  # fmt: skip


def test_a_solid_without_its_top_is_covered() -> None:
    whole, cut = (solid_outline([block(0.25, top=top)]) for top in (True, False))
    assert whole.covered == 0.0
    assert cut.mesh.volume == pytest.approx(1.5e-6, rel=1e-9)
    assert cut.covered == pytest.approx(1.0 / (2.0 + 4.0 * 1.5), rel=1e-9)
    for outline in (whole, cut):
        motion = outline.motions[0]
        assert abs(outline.mesh.areas @ motion[:, -1]) < 1e-15
        # divided into four, each with the field of its face
        assert outline.mesh.areas @ motion[:, 0] == pytest.approx(1e-4, rel=1e-6)
    k = 100.0
    one, other = (radiation(o.mesh, k, o.motions[0][:, [0, -1]]).matrix for o in (whole, cut))
    assert np.diag(other) == pytest.approx(np.diag(one), rel=0.02)


def test_a_cover_moves_as_the_faces_around_it_of_its_direction() -> None:
    """A hole in the middle of the bottom: two triangles left out."""
    own = block(0.2)
    middle = own.points[own.faces].mean(axis=1)
    hole = np.flatnonzero((middle[:, 2] < -0.0074) & (np.abs(middle[:, :2]).max(axis=1) < 1.1e-3))
    assert hole.size == 2
    kept = np.setdiff1d(np.arange(len(own.faces)), hole)
    names = ("faces", "face_group", "face_area", "axial_normals", "face_shapes", "face_residual")
    outline = solid_outline([replace(own, **{name: getattr(own, name)[kept] for name in names})])
    assert outline.covered == pytest.approx(0.04 / 8.0, rel=1e-9)
    rest = outline.group == len(outline.groups) - 1
    assert outline.motions[0][rest, 0] == pytest.approx(1.0)
    assert outline.mesh.areas @ outline.motions[0][:, 0] == pytest.approx(1e-4, rel=1e-6)


def test_a_solid_over_frequency() -> None:
    """Between the frequencies that were solved, 0.1 dB."""
    own = block(0.5)
    (found,) = surface_radiation([own], C)
    outline = solid_outline([own])
    for f in (700.0, 3300.0, 12e3):
        exact = radiation(outline.mesh, 2.0 * pi * f / C, outline.motions[0][:, [0, -1]]).matrix
        unit = np.eye(3, dtype=complex)[[0, 2]]
        power = [found.power(np.array([f]), row[None]).sum() for row in unit]
        assert 10.0 * np.log10(power / np.diag(exact)) == pytest.approx(0.0, abs=0.1)


def test_solids_that_cannot_be_used() -> None:
    with pytest.raises(InputError, match="bodies of revolution together with solids"):
        surface_radiation([block(0.5), cup()], C)
    with pytest.raises(InputError, match=r"faces on the outside(.|\n)*more coarsely"):
        solid_outline([block(0.06)])


def test_far_pressure_of_a_sphere_with_its_phase() -> None:
    """Series of Hankel functions, off the solved frequencies; its middle is off zero.

    Breathing it is as loud all round (0.1 dB); phases 2 % of the largest pressure.
    """
    raised = 0.05
    angle = np.linspace(pi, 0.0, 91)
    way = 0.02 * np.column_stack([np.abs(np.sin(angle)), np.cos(angle)])
    own = structure("ball", {"skin": way + np.array([0.0, raised])})
    (found,) = surface_radiation([own], C)
    f = np.geomspace(30.0, 19e3, 23)
    k = 2.0 * pi * f[:, None] / C
    cosine = np.cos(ANGLES)
    for column, n in ((0, 0), (-1, 1)):
        unit = np.zeros((f.size, 3), dtype=complex)
        unit[:, column] = 1.0
        slope = spherical_jn(n, 0.02 * k, True) - 1j * spherical_yn(n, 0.02 * k, True)
        exact = -1j * 1j ** (n + 1) / (k * slope) * eval_legendre(n, cosine)
        exact = exact * np.exp(1j * k * raised * cosine)
        apart = np.abs(found.far_pressure(f, unit) - exact).max(axis=1)
        assert np.all(apart < 0.02 * np.abs(exact).max(axis=1))
        uniform = np.abs(found.far_pressure(f, unit))
        if n == 0:
            assert np.ptp(20.0 * np.log10(uniform), axis=1).max() < 0.1


def test_power_around_is_the_power_through_the_surface(sphere) -> None:
    """All fields at once; the rule of Simpson over 37 angles."""
    _, found = sphere
    rng = np.random.default_rng(7)
    f = np.geomspace(600.0, 18e3, 9)
    fields = rng.normal(size=(9, 5)) + 1j * rng.normal(size=(9, 5))
    fields[:, 3] = 0.0
    density = np.abs(found.far_pressure(f, fields)) ** 2 * np.sin(ANGLES)
    around = 2.0 * pi * simpson(density, x=ANGLES, axis=1)
    through = found.power(f, fields).sum(axis=0)
    assert np.abs(10.0 * np.log10(around / through)).max() < 0.1
