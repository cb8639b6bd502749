"""An impact as a film: truth = the full-order fields, which recovered ones must resemble."""

from pathlib import Path
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest

from klack.case import find_case, load_case
from klack.errors import InputError
from klack.exchange.results.vtk_series import write_impact_series

FRAMES = 12
Film = dict[str, list[tuple[float, meshio.Mesh]]]


def read_film(path: Path) -> Film:
    film: Film = {}
    for item in ElementTree.parse(path).getroot().iter("DataSet"):
        grid = meshio.read(path.parent / item.attrib["file"])
        film.setdefault(item.attrib["name"], []).append((float(item.attrib["timestep"]), grid))
    return film


@pytest.fixture(scope="module")
def films(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Film]:
    case = load_case(find_case(Path("demo-valve-axisymmetric")))
    folder = tmp_path_factory.mktemp("films")
    return {
        level: read_film(write_impact_series(case, folder, level=level, frames=FRAMES))
        for level in ("full", "reduced")
    }


def test_both_bodies_are_there_at_every_instant(films: dict[str, Film]):
    for film in films.values():
        assert list(film) == ["needle", "housing"]
        times = [time for time, _ in film["needle"]]
        assert FRAMES - 1 <= len(times) <= FRAMES
        assert [time for time, _ in film["housing"]] == times
        np.testing.assert_allclose(np.diff(times), np.diff(times)[0], rtol=1e-6)
        for _, grid in (*film["needle"], *film["housing"]):
            assert set(grid.point_data) == {"displacement", "velocity", "stress", "von_mises"}


def test_a_film_begins_with_free_flight(films: dict[str, Film]):
    for film in films.values():
        _, grid = film["needle"][0]
        np.testing.assert_allclose(grid.point_data["velocity"][:, 2], -0.3, rtol=1e-5)
        np.testing.assert_allclose(film["housing"][0][1].point_data["displacement"], 0.0)


@pytest.mark.parametrize("body", ["needle", "housing"])
def test_recovered_fields_resemble_those_of_the_full_order(films: dict[str, Film], body: str):
    """Both films have slightly different instants; compared at the highest stress.

    Displacement within 1 %, equivalent stress within 3 % of its norm, its peak within 3 %: with the
    static rest of the modes.  Without it the peak stress is wrong by more than half.
    """
    full, reduced = films["full"][body], films["reduced"][body]
    k = max(range(len(full)), key=lambda i: full[i][1].point_data["von_mises"].max())
    j = min(range(len(reduced)), key=lambda i: abs(reduced[i][0] - full[k][0]))
    expected, found = full[k][1].point_data, reduced[j][1].point_data

    for field, allowed in (("displacement", 0.01), ("von_mises", 0.03)):
        difference = np.linalg.norm(found[field] - expected[field])
        assert difference < allowed * np.linalg.norm(expected[field])
    assert found["von_mises"].max() == pytest.approx(expected["von_mises"].max(), rel=0.03)
    assert expected["von_mises"].max() > 5e8  # the contact is in the picture


def test_one_frame_makes_no_film(tmp_path: Path):
    case = load_case(find_case(Path("demo-valve-axisymmetric")))

    with pytest.raises(InputError, match="at least 2"):
        write_impact_series(case, tmp_path, level="reduced", frames=1)
