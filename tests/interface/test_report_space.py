"""Bodies of a report in space; the truth is two boxes, one on the other."""

import re
from base64 import b64decode, b64encode
from dataclasses import replace
from io import BytesIO
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.image import imread

from klack.analyses.impact.content import report_content
from klack.analyses.impact.record import BodyPicture, ImpactStudy
from klack.analyses.impact.solid_figure import solid_figure
from klack.mesh.mesh import ElementBlock, FaceBlock, Mesh, Surface
from klack.mesh.skin import skin_of_mesh
from klack.report.html import render_html
from klack.report.pdf import render_pdf

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
