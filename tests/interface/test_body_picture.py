"""Pictures that move; truth: the recovered motion of all nodes, instant by instant."""

from pathlib import Path

import numpy as np
import pytest

from klack.analyses.impact.body_picture import body_pictures
from klack.analyses.impact.levels import run_reduced
from klack.analyses.impact.record import BodyPicture
from klack.analyses.impact.recovered_motion import recovered_motion
from klack.assembling.modes import mode_pools
from klack.assembling.problem import build_problem
from klack.assembling.reduced_pair import first_stiffness, own_pair
from klack.bodies.elasticity.stress import StressField, von_mises
from klack.case import load_case
from klack.machine.progress import silent

CASE = Path(__file__).parents[1] / "data" / "small_ball.yaml"


@pytest.fixture(scope="module")
def problem():
    made = build_problem(load_case(CASE), silent)
    yield made
    made.close()


@pytest.fixture(scope="module")
def pools(problem):
    return mode_pools(problem, at_least=1, progress=silent)


@pytest.fixture(scope="module")
def pair(problem, pools):
    return own_pair(problem, pools, stiffness=first_stiffness(problem))


@pytest.fixture(scope="module")
def ran(problem, pair):
    return run_reduced(problem.case, pair, level="reduced", label="reduced", setup_time=0.0)


@pytest.fixture(scope="module")
def pictures(problem, pools, pair, ran):
    return body_pictures(problem, pools, pair, ran)


def displacement(picture: BodyPicture, frame: int) -> np.ndarray:
    """Of the nodes on the surface at one instant, shape (n, dimension) [m]."""
    weights = picture.amplitude[frame] * picture.scale / 32767
    return np.einsum("m,mnd->nd", weights, picture.shapes.astype(float))


def test_its_instants_begin_at_rest_and_hold_the_highest_force(pictures, ran):
    upper, lower = pictures

    assert upper.instants[0] == 0.0
    np.testing.assert_array_equal(upper.instants, lower.instants)
    force = upper.amplitude[:, np.isnan(upper.frequency)][:, -1]
    assert force.max() == pytest.approx(ran.history.force.max(), rel=1e-6)


def test_a_face_with_several_names_belongs_to_the_contact(problem, pictures):
    for picture, surface in zip(
        pictures, (problem.pair.upper_surface, problem.pair.lower_surface), strict=True
    ):
        assert picture.skin.faces[0] == surface.name  # the first of several names is taken


def test_its_surface_moves_as_the_recovered_nodes(problem, pictures):
    force = pictures[0].amplitude[:, -1]
    peak = int(np.argmax(force))
    number = round(pictures[0].instants[peak] / problem.case.run.reduced_step)

    (_, motion) = next(iter(recovered_motion(problem, [number], silent)))

    for picture, body in zip(pictures, motion, strict=True):
        true = body.displacement.reshape(-1, 2)
        seen = displacement(picture, peak)
        # shapes are rounded to 1/32767 of their largest displacement, and the pattern of the port
        # stands for that of the highest force, which differs by up to 2 %
        np.testing.assert_allclose(
            seen, true[picture.node], atol=2e-3 * np.abs(true[picture.node]).max()
        )


def test_its_stress_is_that_of_the_recovered_nodes(problem, pictures):
    picture = pictures[0]
    peak = int(np.argmax(picture.amplitude[:, -1]))
    number = round(picture.instants[peak] / problem.case.run.reduced_step)
    (_, motion) = next(iter(recovered_motion(problem, [number], silent)))
    body = problem.pair.upper
    field = StressField(body.mesh, problem.case.materials_of(body.name, body.mesh.solids))
    true = np.zeros(body.mesh.node_count)
    np.maximum.at(true, field.nodes, von_mises(field(motion[0].displacement)))

    np.testing.assert_allclose(
        picture.stress, true[picture.node], rtol=5e-3, atol=1e-3 * true.max()
    )


def test_held_vertices_do_not_move(pictures):
    lower = pictures[1]
    assert lower.held.any()
    place = np.searchsorted(lower.node, lower.skin.node[lower.held])
    assert not lower.shapes[:, place].any()


def test_without_the_reduced_level_it_has_modes_and_no_motion(problem, pools, pair):
    upper, lower = body_pictures(problem, pools, pair, None)

    for picture, model in ((upper, pair.upper), (lower, pair.lower)):
        np.testing.assert_allclose(
            picture.frequency, model.frequencies[model.rigid_count :], rtol=1e-9
        )
        assert picture.instants.size == picture.amplitude.size == picture.stress.size == 0


def test_the_touch_is_on_the_lower_body(pictures):
    upper, lower = pictures
    assert len(upper.touch) == 0
    assert len(lower.touch) in (0, 90)
