"""Whole runs with the cache off, empty and full.

Exact: every number of a run is the same, bit by bit, whether it was computed or taken from the
cache; what the cache gives depends on content alone.
"""

import os
import re
import shutil
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np
import pytest

import klack.machine.cache.result_cache as setting
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.impact.run import run_impact
from klack.analyses.reduction.run import run_reduce
from klack.assembling.generated_mesh import meshed_profiles, meshed_step
from klack.assembling.modes import mode_pools
from klack.assembling.problem import build_problem
from klack.bodies.elasticity import statics
from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.statics import Flexibility
from klack.case import find_case, read_case
from klack.case.geometry import StepFile
from klack.case.schema import Case
from klack.errors import InputError
from klack.machine.cache.result_cache import result_cache
from klack.machine.stages import stages_with_cached
from klack.materials.material import Material
from klack.mesh.profile import Line, Profile
from klack.mesh.sizing import MeshSizing
from klack.mesh.solid import write_step_revolved

pytestmark = pytest.mark.slow

TIMES = {"wall_time", "setup_time", "stage_times", "created"}
PATH = find_case("demo-valve-axisymmetric")
TEXT = PATH.read_text()
BAR = Profile(
    (0, 0),
    (
        Line((1e-3, 0), "foot"),
        Line((1e-3, 4e-3), "side"),
        Line((0, 4e-3), "top"),
        Line((0, 0), "axis"),
    ),
)
STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)


def case_with(*changes: tuple[str, str]) -> Case:
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return read_case(text, PATH)


def numbers(value: object, path: str = "") -> dict[str, object]:
    """Every number and text of a result by its place, the times of the clock left out."""
    if isinstance(value, np.ndarray):
        return {path: (value.dtype.str, value.shape, value.tobytes())}
    if is_dataclass(value) and not isinstance(value, type):
        parts = {f.name: getattr(value, f.name) for f in fields(value) if f.name not in TIMES}
    elif isinstance(value, Mapping):
        parts = {str(name): item for name, item in value.items()}
    elif isinstance(value, (tuple, list)):
        parts = {str(i): item for i, item in enumerate(value)}
    else:
        return {path: repr(value)}
    found: dict[str, object] = {}
    for name, item in parts.items():
        found |= numbers(item, f"{path}.{name}")
    return found


@pytest.fixture(scope="module")
def runs(tmp_path_factory) -> dict[str, ImpactStudy]:
    """One case, computed without a cache, with an empty one and with the one that this left."""
    folder = tmp_path_factory.mktemp("cache")
    case, studies = case_with(), {}
    levels = ("reduced", "reduced-attachment")  # and the interface level, for the estimate
    with pytest.MonkeyPatch.context() as patch:
        for name, place in (("off", "off"), ("cold", str(folder)), ("warm", str(folder))):
            patch.setenv("KLACK_CACHE", place)
            setting._at.cache_clear()  # as in another process
            studies[name] = run_impact(case, levels=levels, threads=1)
    return studies


@pytest.mark.parametrize("name", ["cold", "warm"])
def test_every_number_is_the_same(runs, name):
    expected, found = numbers(runs["off"]), numbers(runs[name])

    assert len(expected) > 200
    assert sum(isinstance(item, tuple) for item in expected.values()) > 50  # arrays
    assert [place for place in expected if found.get(place) != expected[place]] == []
    assert found.keys() == expected.keys()


def test_the_stages_say_what_came_from_the_cache(runs):
    stages = {name: tuple(study.stage_times) for name, study in runs.items()}

    for name in ("off", "cold"):  # what a run has stored itself does not count
        assert not stages_with_cached(runs[name].stage_times)
    assert len(stages["off"]) == len(stages["cold"]) == len(stages["warm"])
    cached = set(stages_with_cached(runs["warm"].stage_times))
    assert cached >= {"mesh", "factorise", "static contact", "modes", "transfer functions"}


def test_a_result_says_nothing_of_the_folder(runs):
    folder = str(result_cache().folder) if result_cache() else "cache0"

    assert not re.search(re.escape(folder), repr(numbers(runs["warm"])))


def prepare(case: Case) -> set[str]:
    """Stages of the preparation that computed something."""
    cache, computed, last = result_cache(), set(), [""]
    before = cache.missed.copy()

    def progress(stage: str, fraction: float) -> None:
        if cache.missed != before:
            computed.add(last[0])
            before.update(cache.missed - before)
        last[0] = stage

    problem = build_problem(case, progress)
    mode_pools(problem, at_least=80, progress=progress)
    progress("", 0.0)
    problem.close()
    return computed


@pytest.fixture(scope="module")
def prepared(tmp_path_factory) -> Path:
    """Cache that the preparation of the case has left."""
    folder = tmp_path_factory.mktemp("prepared")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("KLACK_CACHE", str(folder))
        assert prepare(case_with()) == {"mesh", "factorise", "static contact", "modes"}
    return folder


@pytest.fixture
def counted(tmp_path, monkeypatch):
    """Count the factorisations of a fresh cache; gives the list of their sizes."""
    sizes: list[int] = []
    real = statics.factorize

    def factorize(A, **options):
        sizes.append(A.shape[0])
        return real(A, **options)

    monkeypatch.setenv("KLACK_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(statics, "factorize", factorize)
    return sizes


@pytest.mark.parametrize(
    ("change", "again"),
    [
        ((), set()),
        ((("title:", "title: Another,"),), set()),
        ((("reduced_step: 20 ns", "reduced_step: 10 ns"),), set()),
        ((("needle: {count: 20}", "needle: {count: 19}"),), set()),
        ((("speed: 0.3 m/s", "speed: 0.31 m/s"),), {"static contact"}),
        ((("poisson: 0.3", "poisson: 0.31"),), {"factorise", "static contact", "modes"}),
        ((("density: 7850", "density: 7851"),), {"factorise", "static contact", "modes"}),
    ],
    ids=["nothing", "title", "step", "kept modes", "speed", "Poisson's ratio", "density"],
)
def test_what_a_change_costs(counted, prepared, change, again):
    """Bodies are factorised again only for a result that the change touches."""
    shutil.copytree(prepared, result_cache().folder)

    assert prepare(case_with(*change)) == again
    assert len(counted) == (2 if again else 0)


def test_klack_reduce_takes_from_what_klack_impact_left(counted):
    first = run_reduce(case_with())
    assert counted
    counted.clear()
    again = run_reduce(case_with())

    assert counted == []
    assert numbers(again) == numbers(first)


def bar(length_scale: float = 1.0) -> ElasticBody:
    scaled = Profile(
        (0, 0),
        tuple(
            Line((e.end[0], e.end[1] * length_scale), e.name)
            for e in BAR.edges
            if isinstance(e, Line)
        ),
    )
    mesh = meshed_profiles({"bar": scaled}, MeshSizing(size=0.2e-3), "axisymmetric", None)
    return elastic_body("bar", mesh, {"bar": STEEL})


def test_a_pool_of_more_modes_is_no_answer_to_fewer(counted):
    """Its lowest modes agree to the tolerance of the iteration (1e-8), not to the last bit."""
    body, cache = bar(), result_cache()
    with Flexibility(body, cache=cache) as flexibility:
        many = eigenmodes(body, count=30, flexibility=flexibility)
        few = eigenmodes(body, count=10, flexibility=flexibility)
        again = eigenmodes(body, count=10, flexibility=flexibility)
    with Flexibility(body) as own:
        alone = eigenmodes(body, count=10, flexibility=own)

    assert cache.missed["modes"] == 2
    assert few.shapes.tobytes() == again.shapes.tobytes() == alone.shapes.tobytes()
    assert few.shapes.flags.f_contiguous == again.shapes.flags.f_contiguous
    np.testing.assert_allclose(many.omega[:10], few.omega, rtol=1e-9)


@pytest.mark.parametrize("change", ["stiffness", "mass", "supports", "place", "backend", "threads"])
def test_a_flexibility_is_known_by_its_matrices_and_solver(monkeypatch, tmp_path, change):
    monkeypatch.setenv("KLACK_CACHE", str(tmp_path))
    body, options = bar(), {}
    key = Flexibility(body).key
    if change == "stiffness":
        body.K.data[0] = np.nextafter(body.K.data[0], np.inf)
    elif change == "mass":
        body.M.data[0] = np.nextafter(body.M.data[0], np.inf)
    elif change == "supports":
        body = elastic_body("bar", body.mesh, {"bar": STEEL}, fixed_nodes=[0, 1])
    elif change == "place":
        body = elastic_body("bar", body.mesh.moved(np.array([0.0, 1e-6])), {"bar": STEEL})
    elif change == "backend":
        options = {"backend": "superlu"}
    else:
        options = {"threads": 1}

    assert Flexibility(body, **options).key != key
    assert Flexibility(bar()).key == key


def test_the_name_of_a_body_is_not_in_its_key():
    body = bar()
    other = ElasticBody(name="other", mesh=body.mesh, K=body.K, M=body.M, fixed=body.fixed)

    assert Flexibility(other).key == Flexibility(body).key


def test_a_step_file_is_known_by_what_is_in_it(monkeypatch, tmp_path):
    """The same name with another content is another mesh; another name with the same is not."""
    monkeypatch.setenv("KLACK_CACHE", str(tmp_path / "cache"))
    path, copy, sizing = tmp_path / "a.step", tmp_path / "b.step", MeshSizing(size=1e-3)
    write_step_revolved({"bar": BAR}, path)
    shutil.copy(path, copy)
    cache = result_cache()

    def height(file: Path) -> float:
        return float(meshed_step(StepFile(file=file), sizing).points[:, 2].max())

    first = height(path)
    assert height(copy) == first
    assert cache.missed["mesh"] == 1
    longer = Profile((0, 0), tuple(Line((e.end[0], 1.5 * e.end[1]), e.name) for e in BAR.edges))
    stat = path.stat()
    write_step_revolved({"bar": longer}, path)
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))  # not even the date has changed

    assert height(path) == pytest.approx(1.5 * first, rel=1e-12)
    assert cache.missed["mesh"] == 2


@pytest.mark.parametrize("model", ["axisymmetric", "solid"])
def test_a_stored_mesh_is_the_generated_one(monkeypatch, tmp_path, model):
    sizing, found = MeshSizing(size=0.6e-3), []
    for place in ("off", str(tmp_path), str(tmp_path)):
        monkeypatch.setenv("KLACK_CACHE", place)
        found.append(numbers(meshed_profiles({"bar": BAR}, sizing, model, None)))

    assert found[0] == found[1] == found[2]


def test_an_error_of_the_matrix_is_not_hidden(monkeypatch, tmp_path):
    """A body that cannot be factorised fails at the same place with a cache as without."""
    monkeypatch.setenv("KLACK_CACHE", str(tmp_path))
    body = bar()
    body.K.data[:] = -body.K.data
    for _ in range(2):
        with pytest.raises(InputError, match="not positive definite"):
            Flexibility(body, cache=result_cache())
