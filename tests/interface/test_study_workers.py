"""Points on threads, processes and a cluster.

Truth: the same points on one thread of this process, bit for bit; the log of a study that nothing
interrupted.
"""

import asyncio
import importlib
import importlib.metadata
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from concurrent import futures
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import psutil
import pytest
from energy_ledger import allowed
from rod_valve import ROD

import klack
from klack.analyses.study import dask_workers
from klack.analyses.study.asked_points import AskedPoints
from klack.analyses.study.computing import Agenda
from klack.analyses.study.dask_workers import DaskTasks
from klack.analyses.study.kinds import ask
from klack.analyses.study.processes import PointOrder, SentCase, answered, versions_here
from klack.analyses.study.where import Where, _Fitting
from klack.analyses.workers import Failure
from klack.case.valve import ValveCase
from klack.errors import AccuracyWarning, ConvergenceError, InputError, MissingExtraError
from klack.machine.stages import collected_warnings, trial, warnings_of_threads

pytestmark = pytest.mark.slow  # processes that start, clusters, kills

DATA = Path(__file__).parents[1] / "data"
SMALL = Path(__file__).parents[2] / "docs" / "how-to" / "small_valve.yaml"
PRELOAD = "network.components.spring.preload"
MASS = "network.components.needle.mass"
ROUNDS = "network.components.own.deadly"
MEASURES = ("opening_time", "opening.peak_force", "impacts", "energy_residual")
STUDY = f"""klack: 1
study:
  parameters: {{{PRELOAD}: {{from: 10 N, to: 14 N}}}}
  measures: [opening_time, opening.peak_force]
  design: {{points: 32}}
  variant: dry
"""

MESHED = "      mesh: {file: needle.inp, unit: mm}\n"
DEADLY = '''
import os
import signal
from pathlib import Path
from typing import Any, ClassVar

from pydantic import Field

from klack.network.component import Component
from klack.network.port import ELEMENT
from klack.network.rows import Book, Rows
from klack.network.step_function import python_step


class DeadlySpring(Component):
    """No spring at all, that ends its process so many times: each leaves a file."""

    type: ClassVar[str] = "deadly-spring"
    ports: ClassVar = {"end": ELEMENT}
    deadly: int = Field(ge=0)

    def add_rows(self, rows: Rows) -> None:
        here = Path(__file__).parent
        if self.deadly > len(list(here.glob(f"died-{self.deadly}-*"))):
            for k in range(1000):
                try:
                    (here / f"died-{self.deadly}-{k}").touch(exist_ok=False)
                    break
                except FileExistsError:
                    continue
            os.kill(os.getpid(), signal.SIGKILL)

        def step(par: Any, state: Any, inp: Any, out: Any) -> int:
            out[0] = out[1] = out[2] = 0.0
            return 0

        rows.element(
            python_step(step, parameters=1, states=1, inputs=4, outputs=3),
            ports=(rows.port("end"),),
            parameters=(0.0,),
            state=(0.0,),
            books=(Book("spring", "store"),),
            channels=(),
        )
'''

Point = Mapping[str, str | float]


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    with pytest.importorskip("distributed").LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0"
    ) as found:
        yield found.scheduler_address


@pytest.fixture
def deadly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[klack.CaseOnHand]:
    """A valve that ends the process that computes it as often as a point says."""
    (tmp_path / "deadly_spring.py").write_text(DEADLY)
    monkeypatch.syspath_prepend(tmp_path)
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    monkeypatch.setenv("PYTHONPATH", path)
    module = importlib.import_module("deadly_spring")
    text = SMALL.read_text().replace("duration: 2 ms, step: 20 ns", "duration: 0.2 ms")
    text = text.replace(
        "    magnet:", "    own: {type: 'deadly_spring:DeadlySpring', deadly: 0}\n    magnet:"
    ).replace("spring.end,", "spring.end, own.end,")
    (tmp_path / "deadly.yaml").write_text(text)
    yield klack.load_case(tmp_path / "deadly.yaml", [module.DeadlySpring])
    sys.modules.pop("deadly_spring")


def rows(table: klack.PointTable) -> tuple[Any, ...]:
    numbers = [[float(x).hex() for x in column.values] for column in table.measures]
    return numbers, table.failures, table.warnings


def written(folder: Path) -> list[str]:
    """Lines of the log of a study, in the order of their bytes."""
    (file,) = folder.glob("points-*.jsonl")
    return sorted(file.read_text().splitlines())


def valve(case: klack.CaseOnHand) -> ValveCase:
    assert isinstance(case.checked, ValveCase)
    return case.checked


def asked(case: klack.CaseOnHand, points: list[Point], *measures: str) -> AskedPoints:
    return ask(valve(case), case.tree, points, measures or MEASURES, "dry")


class TestSameRows:
    def test_of_strokes_failures_and_doubts(self, cluster: str):
        """Refused by the case, unable to start, in doubt; with and without a key."""
        points: list[Point] = [
            *({PRELOAD: f"{k} N"} for k in range(8, 16)),
            {MASS: "-3 g"},
            {"network.components.chamber.volume": "0.2 mm^3"},
            {PRELOAD: "60 N"},
            {},
        ]
        truth = klack.run_many(SMALL, points, MEASURES, variant="wet", threads=1)
        assert truth.failed.sum() == 2
        assert any("never left its seat" in note for note in truth.warnings[10])
        for place in ({"workers": 2}, {"dask": cluster}):
            found = klack.run_many(SMALL, points, MEASURES, variant="wet", **place)
            assert rows(found) == rows(truth)

    def test_of_new_bodies_and_of_a_relative_path(
        self, cluster: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ):
        """Meshes, modes and laws, made by each; errors name the file as it was given."""
        from_here = tmp_path / "rod.yaml"
        from_here.write_text(ROD)
        monkeypatch.chdir(tmp_path)
        edges = [f"bodies.needle.geometry.profile.parts.needle.edges.{i}.line.1" for i in (1, 2)]
        points: list[Point] = [
            dict.fromkeys(edges, 18.0 + k // 2) | {PRELOAD: f"{4 + k % 2} N"} for k in range(6)
        ]
        points += [dict.fromkeys(edges, 0.0), {"bodies.needle.damping.modal": "-5 %"}]
        measures = ("opening_time", "opening.1.peak_force", "energy_throughput")
        truth = klack.run_many("rod.yaml", points, measures, threads=1)
        assert truth.failed.tolist() == [False] * 6 + [True] * 2
        assert truth.failures[7].startswith("rod.yaml:")
        for place in ({"workers": 2}, {"dask": cluster}):
            assert rows(klack.run_many("rod.yaml", points, measures, **place)) == rows(truth)

    def test_of_the_log_whoever_computed(self, cluster: str, tmp_path: Path):
        study = tmp_path / "study.yaml"
        study.write_text(STUDY)
        found = {}
        for name, place in {
            "threads": {"threads": 2},
            "processes": {"workers": 2},
            "dask": {"dask": cluster},
        }.items():
            record = klack.run_study(SMALL, study, folder=tmp_path / name, **place).record
            assert (record.computed, record.threads) == (33, 2)
            found[name] = written(tmp_path / name)
            assert len(found[name]) == 34
            again = klack.run_study(SMALL, study, folder=tmp_path / name, **place).record
            assert again.computed == 0
        assert found["threads"] == found["processes"] == found["dask"]

    def test_of_an_optimisation(self, tmp_path: Path):
        pytest.importorskip("pymoo")
        study = tmp_path / "study.yaml"
        study.write_text(
            STUDY + "  objectives: {opening_time: minimise}\n"
            "  search: {population: 8, generations: 2}\n"
        )
        found = [
            klack.optimise(SMALL, study, folder=tmp_path / name, **place).record
            for name, place in (("threads", {}), ("processes", {"workers": 2}))
        ]
        assert written(tmp_path / "threads") == written(tmp_path / "processes")
        assert found[0].optimum.best == found[1].optimum.best
        assert found[1].workers == "processes"

    def test_of_an_fmu_in_each_process(
        self, cluster: str, tmp_path: Path, spring_damper_fmu: Callable[..., Path]
    ):
        """An FMU fails when a step is forgotten or done twice."""
        text = SMALL.read_text().replace("duration: 2 ms, step: 20 ns", "duration: 0.1 ms")
        text = text.replace(
            "    magnet:",
            f"    own: {{type: fmu, file: '{spring_damper_fmu(2)}', coupling_step: 1 us,\n"
            "          displacement: x, velocity: v, force: F, parameters: {k: 1000, c: 1}}\n"
            "    magnet:",
        ).replace("spring.end,", "spring.end, own.end,")
        (tmp_path / "own.yaml").write_text(text.replace("variants: [dry, wet]", "variants: [dry]"))
        points: list[Point] = [{PRELOAD: f"{k} N"} for k in range(10, 16)]
        measures = ["opening_time_at_50_percent", "energy_throughput"]
        with allowed("simulate_network", 1e-6):  # explicit coupling
            truth = klack.run_many(tmp_path / "own.yaml", points, measures, threads=1)
        found = klack.run_many(tmp_path / "own.yaml", points, measures, dask=cluster)
        assert not truth.failed.any()
        assert rows(found) == rows(truth)

    def test_of_a_class_in_the_script_itself(self, deadly: klack.CaseOnHand, tmp_path: Path):
        case = (tmp_path / "deadly.yaml").read_text().replace("deadly_spring:", "__main__:")
        (tmp_path / "script.yaml").write_text(case)
        (tmp_path / "script.py").write_text(
            f"""{DEADLY}
import klack

if __name__ == "__main__":
    case = klack.load_case("script.yaml", [DeadlySpring])
    points = {{"{PRELOAD}": ["10 N", "11 N", "12 N"]}}
    for place in ({{}}, {{"workers": 2}}):
        table = klack.run_many(case, points, ["energy_throughput"], variant="dry", **place)
        print(table.measures[0].values.tolist(), table.failures)
"""
        )
        done = subprocess.run(
            [sys.executable, "script.py"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        first, second = done.stdout.splitlines()
        assert first == second, done.stderr
        assert first.endswith("('', '', '')")


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
class TestWorkersThatDie:
    def test_their_points_are_computed_again_three_times_at_most(
        self, deadly: klack.CaseOnHand, tmp_path: Path
    ):
        points: list[Point] = [{ROUNDS: k, PRELOAD: f"{10 + k} N"} for k in (0, 3, 2)]
        points += [{PRELOAD: f"{k} N"} for k in range(8, 12)]
        table = klack.run_many(deadly, points, ["energy_throughput"], variant="dry", workers=2)
        assert [bool(text) for text in table.failures] == [k == 1 for k in range(7)]
        assert table.failures[1] == "worker died: a worker process died by signal 9, 3 times"
        for k in (2, 3):
            assert len(list(tmp_path.glob(f"died-{k}-*"))) == k
        plain = [{PRELOAD: point[PRELOAD]} for point in points]
        truth = klack.run_many(deadly, plain, ["energy_throughput"], variant="dry")
        left = [k for k in range(7) if k != 1]
        assert table.measures[0].values[left].tolist() == truth.measures[0].values[left].tolist()

    def test_a_point_that_ended_them_is_tried_by_the_next_study(
        self, deadly: klack.CaseOnHand, tmp_path: Path
    ):
        study = tmp_path / "study.yaml"
        study.write_text(
            f"klack: 1\nstudy:\n  parameters: {{{ROUNDS}: {{values: [0, 4]}}}}\n"
            "  measures: [energy_throughput]\n  design: {kind: grid}\n  variant: dry\n"
        )
        out = tmp_path / "out"
        first = klack.run_study(deadly, study, folder=out, workers=1).record
        assert first.failures[0] == ""
        assert first.failures[1].startswith("worker died")
        assert len(written(out)) == 3  # head, point 0, today: as today is point 0, two lines
        second = klack.run_study(deadly, study, folder=out, workers=1).record
        assert second.failures == ("", "")
        assert second.computed == 1

    def test_of_a_cluster(self, deadly: klack.CaseOnHand, tmp_path: Path):
        """Each nanny starts another one."""
        distributed = pytest.importorskip("distributed")
        points: list[Point] = [{ROUNDS: k, PRELOAD: "10 N"} for k in (0, 2)]
        points += [{PRELOAD: f"{k} N"} for k in range(8, 20)]
        plain = [{PRELOAD: point[PRELOAD]} for point in points]
        truth = klack.run_many(deadly, plain, ["energy_throughput"], variant="dry")
        with distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=":0"
        ) as cluster:
            table = klack.run_many(
                deadly, points, ["energy_throughput"], variant="dry", dask=cluster.scheduler_address
            )
        assert table.failures == ("",) * len(points)
        assert table.measures[0].values.tolist() == truth.measures[0].values.tolist()


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
class TestInterrupted:
    """``klack study`` in a process of its own, with two workers."""

    def test_ctrl_c_keeps_what_is_computed(self, tmp_path: Path, whole: list[str]):
        command = started(tmp_path)
        half_way(tmp_path, 20)
        workers = psutil.Process(command.pid).children(recursive=True)
        assert len(workers) >= 2
        command.send_signal(signal.SIGINT)
        _, told = command.communicate(timeout=60)
        assert command.returncode == 130
        kept = len(written(tmp_path / "out")) - 1
        assert f"{kept} computed points are kept" in told
        until(lambda: not any(is_alive(worker) for worker in workers))
        assert resumed(tmp_path) == whole

    @pytest.mark.parametrize("points", [0, 60])
    def test_kill_of_the_command_leaves_no_workers(
        self, points: int, tmp_path: Path, whole: list[str]
    ):
        command = started(tmp_path)
        half_way(tmp_path, points)
        workers = psutil.Process(command.pid).children(recursive=True)
        command.kill()
        command.communicate(timeout=60)
        until(lambda: not any(is_alive(worker) for worker in workers))
        assert resumed(tmp_path) == whole

    def test_kills_of_workers_change_nothing(self, tmp_path: Path, whole: list[str]):
        command = started(tmp_path)
        for points in (1, 60):
            half_way(tmp_path, points)
            workers = psutil.Process(command.pid).children()
            found = [worker for worker in workers if "spawn_main" in " ".join(worker.cmdline())]
            for worker in found[:1]:
                worker.kill()
        assert command.wait(300) == 0
        assert written(tmp_path / "out") == whole


class TestLongOnes:
    """``klack.run_study`` in this process, on a cluster."""

    def test_ctrl_c_keeps_what_has_come(self, cluster: str, tmp_path: Path):
        study = tmp_path / "study.yaml"
        study.write_text(STUDY.replace("points: 32", "points: 256"))

        def progress(stage: str, fraction: float) -> None:
            if fraction > 0.2:
                raise KeyboardInterrupt

        out = tmp_path / "out"
        with pytest.raises(KeyboardInterrupt):
            klack.run_study(SMALL, study, folder=out, dask=cluster, progress=progress)
        kept = len(written(out)) - 1
        assert 51 <= kept < 257
        record = klack.run_study(SMALL, study, folder=out, dask=cluster).record
        assert (record.kept, record.computed) == (kept, 257 - kept)
        klack.run_study(SMALL, study, folder=tmp_path / "whole", threads=2)
        assert written(out) == written(tmp_path / "whole")


class TestRefused:
    @pytest.mark.parametrize(
        ("given", "words"),
        [
            ({"workers": 0}, "workers: got 0, expected 1 or more"),
            ({"threads": True}, "threads: got True"),
            ({"workers": 2, "threads": 2}, "threads and workers: got several places"),
            ({"workers": 2, "dask": "tcp://localhost:1"}, "workers and dask: got several places"),
        ],
    )
    def test_numbers_that_cannot_be(self, given: dict[str, Any], words: str):
        with pytest.raises(InputError, match=words):
            klack.run_many(SMALL, [{}], ["impacts"], **given)

    def test_too_many_processes_for_the_memory(self, monkeypatch: pytest.MonkeyPatch):
        from klack.machine.memory import AvailableMemory

        small = AvailableMemory(size=1e9, bound="a test")
        monkeypatch.setattr("klack.machine.memory.available_memory", lambda: small)
        with pytest.raises(InputError, match=r"4 processes needing about 2 GB .* \(a test\)"):
            klack.run_many(SMALL, [{}], ["impacts"], workers=4)

    def test_a_cluster_without_dask(self, monkeypatch: pytest.MonkeyPatch):
        monkeypatch.setitem(sys.modules, "distributed", None)
        monkeypatch.setattr("klack.analyses.study.strokes.one_variant", None)
        with pytest.raises(MissingExtraError, match="uv sync --extra dask"):
            klack.run_many(SMALL, [{}], ["impacts"], dask="tcp://localhost:8786")

    @pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nowhere.json", "gopher://x:1"])
    def test_a_scheduler_that_does_not_answer(self, address: str, monkeypatch: pytest.MonkeyPatch):
        pytest.importorskip("distributed")
        monkeypatch.setattr(dask_workers, "_PATIENCE", 1.0)
        with pytest.raises(InputError, match="expected the address of a running Dask scheduler"):
            klack.run_many(SMALL, [{}], ["impacts"], dask=address)

    def test_another_version_of_klack(self, cluster: str, monkeypatch: pytest.MonkeyPatch):
        other = dict(versions_here()) | {"klack": "9.9"}
        monkeypatch.setattr("klack.analyses.study.processes.versions_here", lambda: other)
        with pytest.raises(
            InputError, match=rf"worker tcp://.*got klack {klack.__version__}, expected klack 9.9"
        ):
            klack.run_many(SMALL, [{}], ["impacts"], dask=cluster)

    @pytest.mark.parametrize(
        ("found", "words"),
        [("9.9", "got klack 9.9"), (ImportError("none"), r"got no klack \(none\)")],
    )
    def test_a_worker_without_klack_or_with_another_one(
        self, found: object, words: str, cluster: str, monkeypatch: pytest.MonkeyPatch
    ):
        """Before it is sent anything of klack, which it could not read."""
        distributed = pytest.importorskip("distributed")
        told: list[tuple[Any, ...]] = []

        def run(self: Any, function: Any, *given: Any, **named: Any) -> dict[str, object]:
            told.append((function, *given))
            return dict.fromkeys(named["workers"], found)

        monkeypatch.setattr(distributed.Client, "run", run)
        monkeypatch.setattr(dask_workers, "DaskTasks", None)
        with pytest.raises(InputError, match=rf"worker tcp://.*{words}, expected klack"):
            klack.run_many(SMALL, [{}], ["impacts"], dask=cluster)
        assert told == [(importlib.metadata.version, "klack")]

    def test_a_file_that_is_not_there_or_another_one(self, tmp_path: Path):
        """What a worker of another machine finds."""
        file = tmp_path / "needle.inp"
        file.write_bytes((DATA / "block.inp").read_bytes())
        (tmp_path / "case.yaml").write_text(
            ROD.replace(
                ROD[ROD.index("      model") : ROD.index("    material: steel\n")], MESHED
            ).replace("    mesh: {size: 1 mm}\n", "")
        )
        case = klack.load_case(tmp_path / "case.yaml")
        sent = SentCase.of(valve(case), case.tree)
        order = PointOrder.of(asked(case, [{}]), (0,))
        file.write_bytes(file.read_bytes() + b"** changed\n")
        found = answered(sent, order)
        assert isinstance(found, Failure)
        assert "files or components of the case with different contents" in found.parts[1]
        file.unlink()
        found = answered(sent, order)
        assert isinstance(found, Failure)
        assert "needle.inp" in " ".join(found.parts)
        assert "the same path on every machine" in found.parts[3]

    @pytest.mark.parametrize(
        ("error", "is_lost"),
        [
            (TimeoutError(), True),
            (OSError("gone"), True),
            (futures.CancelledError(), True),
            (asyncio.CancelledError(), True),
            (ValueError("unreadable"), False),
        ],
    )
    def test_rows_that_cannot_be_read_are_not_asked_for_again(
        self, error: BaseException, is_lost: bool
    ):
        """Those of a worker that is lost are: dask has them computed once more."""
        case = klack.load_case(SMALL)
        future = Mock(status="finished")
        future.result.side_effect = error
        future.add_done_callback.side_effect = lambda told: told(future)
        client = Mock()
        client.submit.return_value = future
        sent = SentCase.of(valve(case), case.tree)
        tasks = DaskTasks(client, sent, asked(case, [{}]), Mock(), Mock())
        tasks.submit((0,))
        if is_lost:
            tasks.settle(0.01)
            assert len(tasks) == 1
        else:
            with pytest.raises(ValueError, match="unreadable"):
                tasks.settle(0.01)

    def test_a_class_that_a_worker_cannot_import(self, deadly: klack.CaseOnHand):
        sent = SentCase.of(valve(deadly), deadly.tree)
        order = PointOrder.of(asked(deadly, [{}], "energy_throughput"), (0,))
        gone = replace(sent, content=sent.content.replace(b"deadly_spring", b"absent_spring"))
        found = answered(gone, order)
        assert isinstance(found, Failure)
        assert "a class that cannot be imported there" in found.parts[1]

    def test_a_scheduler_that_is_lost_keeps_what_came(self, tmp_path: Path):
        distributed = pytest.importorskip("distributed")
        study = tmp_path / "study.yaml"
        study.write_text(STUDY.replace("points: 32", "points: 512"))
        cluster = distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, dashboard_address=":0"
        )
        closed = []

        def progress(stage: str, fraction: float) -> None:
            if fraction > 0.05 and not closed:
                closed.append(cluster.close())

        with pytest.raises(ConvergenceError, match="the connection to the Dask scheduler is lost"):
            klack.run_study(
                SMALL,
                study,
                folder=tmp_path / "out",
                dask=cluster.scheduler_address,
                progress=progress,
            )
        assert 20 < len(written(tmp_path / "out")) < 513


class TestChoice:
    def test_points_of_the_same_bodies_stay_at_their_worker(self):
        agenda = Agenda([[0, 1, 2], [3, 4], [5, 6, 7, 8]])
        assert [agenda.take("a"), agenda.take("b"), agenda.take("a")] == [(0,), (3,), (1,)]
        assert agenda.take("b", 5) == (4,)
        assert agenda.take("b") == (5,)  # not begun yet
        assert agenda.take("c") == (2,)  # begun the longest ago
        assert agenda.left == 3
        assert [agenda.take(most=2), agenda.take("a"), agenda.take("a")] == [(6, 7), (8,), ()]
        assert agenda.left == 0

    def test_processes_where_threads_wait_for_each_other(self):
        """Of the command, which says nothing: strokes on threads, noise on processes."""
        case = klack.load_case("demo-stroke")
        where = Where(is_free=True)
        many: list[Point] = [{PRELOAD: f"{10 + k / 100} N"} for k in range(100)]
        edges = [f"bodies.needle.geometry.profile.parts.needle.edges.{i}.line.1" for i in (1, 2)]
        bodies: list[Point] = [dict.fromkeys(edges, 20.0 + k / 100) for k in range(20)]
        noise = "noise.sound_exposure_level_weighted"
        for measure, points, batches, choice in (
            ("opening_time", many, 20, False),
            ("opening_time", bodies[:5], 20, False),
            ("opening_time", bodies, 1, True),
            (noise, many[:5], 1, False),
            (noise, many[:5], 13, True),
        ):
            with where.open(valve(case), case.tree) as workers:
                assert isinstance(workers, _Fitting)
                wanted = asked(case, points, measure)
                found = [workers._pays(wanted, range(len(points))) for _ in range(batches)]
                assert found[-1] == choice
                assert workers.words == "threads"


def started(folder: Path) -> subprocess.Popen[str]:
    """``klack study`` on two workers, in a process of its own."""
    words = ["study", str(SMALL), "--workers", "2", "--study", str(long_study(folder))]
    return subprocess.Popen(
        [sys.executable, "-m", "klack", *words, "-q", "--no-report", "--out", str(folder / "out")],
        stderr=subprocess.PIPE,
        text=True,
        # of a shell that runs the tests in the background it would be deaf for Ctrl-C
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Log of that study when nothing interrupts it: threads write the same as processes."""
    return resumed(tmp_path_factory.mktemp("whole"))


def resumed(folder: Path) -> list[str]:
    """Log after the study has gone on to its end, in this process."""
    klack.run_study(SMALL, long_study(folder), folder=folder / "out", threads=1)
    return written(folder / "out")


def long_study(folder: Path) -> Path:
    study = folder / "study.yaml"
    study.write_text(STUDY.replace("points: 32", "points: 128"))
    return study


def half_way(folder: Path, points: int) -> None:
    """Wait until so many points are in the log."""
    until(lambda: sum(1 for file in folder.glob("out/points-*") for _ in file.open()) > points)


def is_alive(process: psutil.Process) -> bool:
    return process.is_running() and process.status() != psutil.STATUS_ZOMBIE


def until(reached: Callable[[], bool]) -> None:
    end = time.monotonic() + 120.0
    while not reached():
        assert time.monotonic() < end, "nothing came"
        time.sleep(0.01)


def test_warnings_that_threads_catch_at_the_same_time_stay_their_own():
    """A trial inside a trial too; what no trial catches is left for its thread."""
    both = threading.Barrier(2, timeout=60.0)
    found: dict[str, list[str]] = {}

    def work(name: str) -> None:
        both.wait()
        with trial() as outer:
            both.wait()
            warnings.warn(f"{name} outer", AccuracyWarning, stacklevel=1)
            with collected_warnings() as inner:
                both.wait()
                warnings.warn(f"{name} inner", AccuracyWarning, stacklevel=1)
                both.wait()
        both.wait()
        warnings.warn(f"{name} left", AccuracyWarning, stacklevel=1)
        found[name] = [*inner, *(str(item.message) for item in (*outer, *taken()))]

    with warnings_of_threads() as taken:
        crew = [threading.Thread(target=work, args=(name,)) for name in "ab"]
        for thread in crew:
            thread.start()
        for thread in crew:
            thread.join()

    assert found == {name: [f"{name} {at}" for at in ("inner", "outer", "left")] for name in "ab"}
