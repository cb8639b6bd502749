"""Pictures of pressure and of bodies in space.

Pictures of the contact pressure; the truth is a made-up field of pressure on made-up points.

Bodies of a report in space; the truth is two boxes, one on the other.
"""

import re
from base64 import b64decode, b64encode
from dataclasses import replace
from io import BytesIO
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.image import imread

from klack.analyses.impact.contact_map import (
    Cells,
    ContactMap,
    averaged,
    closed,
    contact_map,
    line_load_weights,
)
from klack.analyses.impact.content import report_content
from klack.analyses.impact.pressure_figure import draw_pressure, pressure_figure
from klack.analyses.impact.pressure_view import (
    PressureView,
    common_cells,
    line_load,
    peak_pressure,
    pressure_rows,
    pressure_view,
    study_views,
)
from klack.analyses.impact.record import BodyPicture, ImpactStudy, PressureRecord
from klack.analyses.impact.solid_figure import solid_figure
from klack.mesh.mesh import ElementBlock, FaceBlock, Mesh, Surface
from klack.mesh.skin import skin_of_mesh
from klack.report.html import render_html
from klack.report.pdf import render_pdf

RADIUS, HALF_WIDTH, PEAK, DURATION = 0.4e-3, 20e-6, 1.5e9, 40e-6  # [m], [m], [Pa], [s]
TIME = (np.arange(100) + 0.5) * DURATION / 100


def ring(
    around: int = 36,
    *,
    centre: tuple[float, float] = (0.0, 0.0),
    late: float = 0.0,
    scatter: float = 0.0,
) -> PressureRecord:
    """Semi-elliptic pressure across a ring on a 45 degree cone, half a sine over time.

    At 180 degrees the force begins ``late`` seconds after that at 0 degrees.
    """
    random = np.random.default_rng(4)
    across, angle = np.meshgrid(
        np.linspace(-35e-6, 35e-6, 21), 2 * np.pi * np.arange(around) / around, indexing="ij"
    )
    across, angle = across.ravel(), angle.ravel()
    area = np.full(across.size, 3.5e-6 * 2 * np.pi * RADIUS / around)
    if scatter:
        across = across + scatter * random.uniform(-3.5e-6, 3.5e-6, across.size)
        angle = angle + scatter * random.uniform(-np.pi, np.pi, angle.size) / around
    r, z = RADIUS + across / np.sqrt(2), across / np.sqrt(2)
    points = np.column_stack([r * np.cos(angle) + centre[0], r * np.sin(angle) + centre[1], z])
    begin = 0.5 * late * (1 - np.cos(angle))
    rise = np.sin(np.pi * np.clip((TIME[:, None] - begin) / (DURATION - begin), 0.0, 1.0))
    profile = PEAK * np.sqrt(np.maximum(1 - (across / HALF_WIDTH) ** 2, 0.0))
    force = rise * profile * area
    return PressureRecord(time=TIME, points=points, area=area, point_force=force.astype(np.float32))


def spot(middle: tuple[float, float], radius: float = 120e-6) -> PressureRecord:
    """Hertzian pressure on a circle, on a square grid of points around it."""
    x, y = np.meshgrid(*(np.linspace(-200e-6, 200e-6, 41),) * 2)
    x, y = x.ravel(), y.ravel()
    profile = PEAK * np.sqrt(np.maximum(1 - (x**2 + y**2) / radius**2, 0.0))
    force = np.sin(np.pi * TIME / DURATION)[:, None] * profile * 1e-10
    return PressureRecord(
        time=TIME,
        points=np.column_stack([x + middle[0], y + middle[1], 0.0 * x]),
        area=np.full(x.size, 1e-10),
        point_force=force.astype(np.float32),
    )


def flat(record: PressureRecord, inner: float) -> PressureRecord:
    """Axisymmetric contact: 21 rings of points from ``inner`` outwards."""
    place = np.linspace(-35e-6, 35e-6, 21)
    profile = PEAK * np.sqrt(np.maximum(1 - (place / HALF_WIDTH) ** 2, 0.0))
    r = inner + place - place[0]
    area = 2 * np.pi * np.maximum(r, 1e-6) * 3.5e-6
    force = np.sin(np.pi * TIME / DURATION)[:, None] * profile * area
    return replace(
        record,
        points=np.column_stack([r, 0.0 * r]),
        area=area,
        point_force=force.astype(np.float32),
    )


def sector(record: PressureRecord) -> PressureRecord:
    """Only the points of a ring within 60 degrees of +x."""
    kept = np.abs(np.arctan2(record.points[:, 1], record.points[:, 0])) < np.pi / 3
    return replace(
        record,
        points=record.points[kept],
        area=record.area[kept],
        point_force=record.point_force[:, kept],
    )


def view(record: PressureRecord, title: str = "made up") -> PressureView:
    found = pressure_view(title, record, 0.0)
    assert found is not None
    return found


# --------------------------------------------------------------------------- the kind of contact


@pytest.mark.parametrize(
    ("record", "shape"),
    [
        (ring(), "ring"),
        (ring(centre=(3e-3, 1e-3)), "ring"),
        (ring(scatter=0.8), "ring"),
        (spot((0.0, 0.0)), "spot"),
        (spot((5e-3, 0.0)), "spot"),  # far off the axis it is no ring either
        (sector(ring()), "spot"),
        (flat(ring(), RADIUS), "meridian"),
        (flat(ring(), 0.0), "disc"),
    ],
    ids=["ring", "aside", "scattered", "spot", "spot aside", "sector", "meridian", "disc"],
)
def test_points_and_forces_tell_the_kind_of_contact(record: PressureRecord, shape: str) -> None:
    assert contact_map(record).shape == shape


def test_a_ring_is_unrolled_by_angle_and_distance_along_the_surface() -> None:
    """Points at 0, 10, ... 350 degrees; 21 of them across 70 um on the cone, zero in the middle."""
    found = contact_map(ring())

    assert found.radius == pytest.approx(RADIUS, rel=1e-3)
    np.testing.assert_allclose(np.sort(found.along)[::21] % 360, np.arange(36) * 10.0, atol=1e-6)
    np.testing.assert_allclose(np.unique(found.across.round(9)), np.linspace(-35e-6, 35e-6, 21))


def test_zero_is_where_the_bodies_touch_first() -> None:
    """The contact begins at -14 um and wanders outwards."""
    record = ring()
    across = contact_map(record).across
    moved = record.point_force.copy()
    tenth = 0.1 * moved.sum(axis=1).max()
    moved[:3] = np.where(np.abs(across + 14e-6) < 1e-6, 1.01 * tenth / 36, 0.0)

    found = contact_map(replace(record, point_force=moved))

    np.testing.assert_allclose(found.across, across + 14e-6, atol=1e-7)


# --------------------------------------------------------------------------- fields


@pytest.mark.parametrize("scatter", [0.0, 0.8])
def test_the_line_load_holds_all_the_force(scatter: float) -> None:
    """Its integral round the ring is the sum of the point forces, whatever the mesh."""
    seen = view(ring(scatter=scatter, late=10e-6))
    (cells,) = common_cells([seen])

    load = line_load(seen, cells)

    length = 2 * np.pi * seen.places.radius / load.shape[1]
    np.testing.assert_allclose(load.sum(axis=1) * length, seen.force.sum(axis=1), rtol=1e-12)


def test_the_line_load_of_a_semi_elliptic_pressure() -> None:
    """pi/2 p b; the 21 points across integrate it to 1 %, the mean radius is that of the force."""
    seen = view(ring())
    (cells,) = common_cells([seen])

    load = line_load(seen, cells)[seen.peak]

    np.testing.assert_allclose(load, 0.5 * np.pi * PEAK * HALF_WIDTH, rtol=0.01)


def test_the_line_load_of_a_round_spot() -> None:
    """pi/2 p0 a (1 - x^2/a^2) in the middle of cells of 10 um, which cut chords to 4 %."""
    seen = view(spot((1e-3, 2e-3)))
    (cells,) = common_cells([seen])
    x = 0.5 * (cells.along[1:] + cells.along[:-1])

    load = line_load(seen, cells)[seen.peak]

    middles = 10e-6 * np.arange(-11, 12)
    expected = 0.5 * np.pi * PEAK * 120e-6 * (1 - (middles / 120e-6) ** 2)
    found = load[np.argmin(np.abs(x[:, None] - middles), axis=0)]
    np.testing.assert_allclose(found, expected, atol=0.04 * expected.max())
    assert load.sum() * (x[1] - x[0]) == pytest.approx(seen.force[seen.peak].sum(), rel=1e-12)
    assert not load[np.abs(x) > 126e-6].any()


def test_points_that_alternate_leave_no_trace_in_the_mean_over_an_element() -> None:
    """Corners carry 1.9, middles of sides 0.1, others 1: the pressure is one."""
    owner = np.kron(np.arange(16 * 12).reshape(16, 12), np.ones((3, 5), dtype=int))
    pattern = 1.0 + 0.9 * np.cos(np.pi * np.arange(16))[:, None] * (np.arange(12) % 2 == 0)
    cells = Cells(
        along=np.linspace(0.0, 360.0, 61),
        across=np.linspace(0.0, 1.0, 49),
        owner=owner,
        closed=True,
    )

    mean = averaged(pattern.ravel()[owner], cells)

    np.testing.assert_allclose(mean[3:-3], 1.0, rtol=1e-12)


def test_the_pressure_ends_with_the_surface_not_below_it() -> None:
    """Uniform pressure on a ring of which a part of the picture lies beyond the surface."""
    owner = np.kron(np.arange(8 * 12).reshape(8, 12), np.ones((3, 5), dtype=int))
    owner[:7] = -1
    cells = Cells(
        along=np.linspace(0.0, 360.0, 61),
        across=np.linspace(0.0, 1.0, 25),
        owner=owner,
        closed=True,
    )

    mean = averaged(np.where(owner < 0, 0.0, 1.0), cells)

    np.testing.assert_allclose(mean[7:], 1.0, rtol=1e-12)


def test_single_cells_without_a_force_are_no_holes() -> None:
    """A checkerboard of cells carries everywhere; three empty rows stay empty."""
    owner = np.kron(np.arange(16 * 12).reshape(16, 12), np.ones((3, 5), dtype=int))
    cells = Cells(
        along=np.linspace(0.0, 360.0, 61),
        across=np.linspace(0.0, 1.0, 49),
        owner=owner,
        closed=True,
    )
    carries = np.add.outer(np.arange(16), np.arange(12)) % 2 == 0
    carries[6:9] = False

    found = closed(carries.ravel()[owner], cells)

    assert found[3:15].all()
    assert not found[18 + 3 : 27 - 3].any()
    assert found[30:-3].all()


def test_the_pressure_at_peak_force() -> None:
    """Its highest value is that of the middle, less what an element of 7 um averages away."""
    seen = view(ring())
    (cells,) = common_cells([seen])

    pressure = peak_pressure(seen, cells)

    assert pressure.max() == pytest.approx(PEAK, rel=0.02)
    middle = 0.5 * (cells.across[1:] + cells.across[:-1])
    assert not pressure[np.abs(middle) > HALF_WIDTH + 1.8e-6].any()


def test_a_point_without_a_rectangle_gives_its_force_to_its_column() -> None:
    places = ContactMap(
        shape="ring", along=np.array([10.0, 200.0]), across=np.zeros(2), radius=RADIUS
    )
    cells = Cells(
        along=np.linspace(0.0, 360.0, 5),
        across=np.linspace(0.0, 1.0, 2),
        owner=np.zeros((1, 4), dtype=np.int64),
        closed=True,
    )

    weights = line_load_weights(places, cells)

    np.testing.assert_allclose(weights.sum(axis=1) * 0.5 * np.pi * RADIUS, 1.0)
    assert np.flatnonzero(weights[1]).tolist() == [2]


# --------------------------------------------------------------------------- words and pictures


@pytest.mark.slow
def test_numbers_of_a_ring_that_closes_slowly() -> None:
    """First touch at 0 degrees, closed all round when 180 degrees begin, 10 us later."""
    rows = {row[0]: row[1:] for row in pressure_rows([view(ring()), view(ring(late=10e-6))])}

    assert rows["first touch"] == ("all round at once", "at 0°")
    assert rows["closed all round"][0].startswith("until 39.")
    assert rows["closed all round"][1].startswith("from 10.2")  # middle of the next record
    assert "even round the ring" in rows["line load at the peak force"][0]
    assert "to" in rows["line load at the peak force"][1]


@pytest.mark.slow
@pytest.mark.parametrize(
    "record", [ring(), spot((0.0, 0.0)), flat(ring(), RADIUS), flat(ring(), 0.0)]
)
def test_one_run_and_two_runs_are_drawn(record: PressureRecord) -> None:
    one, other = view(record, "$ <one>"), view(record, "other")

    figure = pressure_figure([one])

    assert figure.image.startswith(b"<?xml")
    assert len(figure.image) < 4e5
    assert "White: no contact" in figure.note
    assert draw_pressure([one, other]).startswith(b"<?xml")


@pytest.mark.slow
def test_the_report_shows_the_pressure_of_levels_that_have_it(impact_study: ImpactStudy) -> None:
    study = with_pressure(impact_study, ring())

    content = report_content(study)

    section = next(item for item in content.sections if item.title == "Pressure in the contact")
    assert section.picture is not None
    assert section.tables[0].columns == ("", study.levels["full"].label)
    page = render_html(content)
    assert "closed all round" in page
    assert len(page) < 5e6
    assert "Pressure in the contact" not in render_html(report_content(impact_study))


@pytest.mark.slow
def test_the_paper_shows_the_pressure(impact_study: ImpactStudy) -> None:
    plain, more = (
        render_pdf(report_content(study))
        for study in (impact_study, with_pressure(impact_study, ring()))
    )

    assert len(more) > len(plain) + 10_000


def test_nothing_carried_is_no_picture(impact_study: ImpactStudy) -> None:
    record = ring()
    empty = replace(record, point_force=np.zeros_like(record.point_force))

    assert study_views(with_pressure(impact_study, empty)) == ()
    assert pressure_view("none", None, 0.0) is None


def test_only_contacts_of_one_kind_stand_side_by_side(impact_study: ImpactStudy) -> None:
    study = with_pressure(impact_study, ring())
    reduced = replace(study.levels["reduced"], pressure=spot((0.0, 0.0)))

    views = study_views(replace(study, levels={**study.levels, "reduced": reduced}))

    assert [item.places.shape for item in views] == ["ring"]


def with_pressure(study: ImpactStudy, record: PressureRecord) -> ImpactStudy:
    full = replace(study.levels["full"], pressure=record)
    return replace(study, levels={**study.levels, "full": full})


HOSTILE = "<b>x</b> $x_1$ -- \\ & \"'"
TITLE = "The bodies in space"


def picture(name: str, width: float, bottom: float, face: str, held: bool) -> BodyPicture:
    """A box of 5 mm height on the axis; ``below`` is its lower face, other names its upper one."""
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    points = corners * [width, width, 5e-3] - [0.5 * width, 0.5 * width, -bottom]
    nodes = [0, 1, 3, 2] if face == "below" else [4, 5, 7, 6]
    mesh = Mesh(
        points=points,
        blocks=(ElementBlock("hex8", np.array([[0, 1, 3, 2, 4, 5, 7, 6]]), name),),
        surfaces={face: Surface(face, (FaceBlock("quad4", np.array([nodes])),))},
    )
    skin = skin_of_mesh(mesh)
    node = np.unique(skin.node)
    return BodyPicture(
        body=name,
        skin=skin,
        # of the lower body the face x = 2 mm: vertices of one smooth part
        held=held & (skin.normals[:, 0] > 0.9),
        section=np.empty((0, 2, 3)),
        finest=1e-3,
        node=node,
        shapes=np.zeros((0, len(node), 3), dtype=np.int16),
        scale=np.empty(0),
        frequency=np.empty(0),
    )


@pytest.fixture(scope="module")
def solid_study(impact_study: ImpactStudy) -> ImpactStudy:
    needle = picture("needle", 2e-3, 0.0, "below", held=False)
    housing = picture("housing", 4e-3, -5e-3, "seat", held=True)
    return replace(
        impact_study,
        bodies=tuple(replace(body, model="3-D") for body in impact_study.bodies),
        contact=replace(impact_study.contact, surfaces="needle.below on housing.seat"),
        sections=(),
        pictures=(needle, housing),
    )


def images(svg: bytes) -> list[np.ndarray]:
    found = re.findall(rb"data:image/png;base64,([A-Za-z0-9+/=\s]+)", svg)
    return [imread(BytesIO(b64decode(one)))[..., :3] for one in found]


def share(image: np.ndarray, wanted: tuple[float, float, float]) -> float:
    """Of the pixels whose colour is ``wanted``, in any brightness."""
    length = np.linalg.norm(image, axis=2)
    along = image @ np.array(wanted) / np.linalg.norm(wanted)
    return float(np.mean((along > 0.995 * length) & (length > 0.2)))


RED, GREEN = (0.784, 0.196, 0.122), (0.180, 0.420, 0.227)


@pytest.mark.slow
def test_a_picture_shows_contact_and_held_faces(solid_study: ImpactStudy) -> None:
    figure = solid_figure(solid_study)

    whole, near = images(figure.image)
    assert whole.shape[1] == near.shape[1] == 720
    assert 0.01 < share(whole, RED) < 0.2
    assert share(whole, GREEN) > 0.01
    assert len(figure.image) < 300_000
    assert "held in all directions" in figure.note
    assert "first touch" not in figure.note  # faces that touch all at once have no ring


@pytest.mark.slow
def test_nothing_is_red_or_striped_without_a_contact_face_or_a_support(
    solid_study: ImpactStudy,
) -> None:
    upper, lower = solid_study.pictures
    free = replace(lower, held=np.zeros_like(lower.held))
    study = replace(
        solid_study,
        contact=replace(solid_study.contact, surfaces="needle.other on housing.none"),
        pictures=(upper, free),
    )

    figure = solid_figure(study)

    for image in images(figure.image):
        assert share(image, RED) == share(image, GREEN) == 0.0
    assert "The contact face of the needle is not known" in figure.note
    assert "held" not in figure.note


@pytest.mark.slow
def test_the_ring_of_first_touch_sets_the_enlarged_window(solid_study: ImpactStudy) -> None:
    turn = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    ring = np.column_stack([1e-4 * np.cos(turn), 1e-4 * np.sin(turn), 0 * turn])
    upper, lower = solid_study.pictures
    figure = solid_figure(replace(solid_study, pictures=(upper, replace(lower, touch=ring))))

    assert b"<!-- 0.1 mm -->" in figure.image  # of 0.44 mm across
    assert b"<!-- first touch -->" in figure.image
    assert "first touch" in figure.note


@pytest.mark.slow
def test_names_are_text_and_the_picture_is_xml(solid_study: ImpactStudy) -> None:
    study = replace(
        solid_study,
        pictures=tuple(replace(one, body=HOSTILE) for one in solid_study.pictures),
        contact=replace(solid_study.contact, surfaces=HOSTILE),
    )

    content = report_content(study)

    section = next(one for one in content.sections if one.title == TITLE)
    assert section.picture is not None
    ElementTree.fromstring(section.picture.image)
    assert "<b>x</b>" not in render_html(content)


@pytest.mark.slow
def test_long_names_are_shortened_in_the_legend(solid_study: ImpactStudy) -> None:
    upper, lower = solid_study.pictures
    study = replace(solid_study, pictures=(replace(upper, body="n" * 200), lower))

    image = solid_figure(study).image

    assert f"<!-- {'n' * 31}… -->".encode() in image
    assert b"n" * 33 not in image


@pytest.mark.slow
def test_html_and_paper_have_the_picture(solid_study: ImpactStudy) -> None:
    content = report_content(solid_study)

    (section,) = (one for one in content.sections if one.title == TITLE)
    assert section.picture is not None
    alone = replace(content, sections=(section,))
    assert b64encode(section.picture.image).decode() in render_html(alone)
    assert b"/Subtype/Image" in render_pdf(alone).replace(b" ", b"")


@pytest.mark.slow
def test_axisymmetric_bodies_have_their_section_instead(impact_study: ImpactStudy) -> None:
    titles = [section.title for section in report_content(impact_study).sections]

    assert TITLE not in titles
    assert "The bodies at peak force" in titles


def test_a_result_without_surfaces_says_so(solid_study: ImpactStudy) -> None:
    content = report_content(replace(solid_study, pictures=()))

    section = next(one for one in content.sections if one.title == TITLE)
    assert section.picture is None
    assert "earlier versions" in section.paragraphs[0]


@pytest.mark.slow
def test_a_spot_of_first_touch_is_not_joined_to_a_ring(solid_study: ImpactStudy) -> None:
    """Nodes within a pitch round a dome, as a mesh gives them: points, not a star."""
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    radius = np.linspace(2e-6, 5e-5, 40)
    spot = np.column_stack([radius * np.cos(5 * turn), radius * np.sin(5 * turn), 0 * turn])
    upper, lower = solid_study.pictures
    study = replace(solid_study, pictures=(upper, replace(lower, touch=spot)))

    assert "The points of first touch" in solid_figure(study).note
