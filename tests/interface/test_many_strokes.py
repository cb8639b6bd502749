"""Strokes at many points.

Truth: single strokes of the changed cases, ``klack.run_stroke(case.with_value(...))``, bit for bit.
"""

import csv
import json
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from energy_ledger import allowed
from rod_valve import ROD

import klack
from klack.analyses.point_table import NOT_COMPUTED
from klack.case.points import case_at, checked_parts, points_of
from klack.case.valve import ValveCase
from klack.errors import InputError, KlackError

SMALL = Path(__file__).parents[2] / "docs" / "how-to" / "small_valve.yaml"
PRELOAD = "network.components.spring.preload"
GAP = "network.components.opening.gap"
DAMPING = "bodies.needle.damping.modal"
LENGTHS = [f"bodies.needle.geometry.profile.parts.needle.edges.{i}.line.1" for i in (1, 2)]
MEASURES = (
    "opening_time",
    "closing_time_at_50_percent",
    "impacts",
    "complete",
    "energy_residual",
    "seat.1.peak_force",
    "opening.1.restitution",
    "opening.2.approach_speed",
)

PLAIN = '''
from typing import Any, ClassVar

from pydantic import Field

from klack.network.component import Component
from klack.network.port import ELEMENT
from klack.network.rows import Book, Rows
from klack.network.step_function import python_step
from klack.units import Stiffness


class PlainSpring(Component):
    """A spring in Python that counts its calls in what all of its kind share."""

    type: ClassVar[str] = "plain-spring"
    ports: ClassVar = {"end": ELEMENT}
    inside: ClassVar[list[int]] = [0, 0]
    stiffness: Stiffness = Field(gt=0)

    def add_rows(self, rows: Rows) -> None:
        def step(par: Any, state: Any, inp: Any, out: Any) -> int:
            PlainSpring.inside[0] += 1
            PlainSpring.inside[1] = max(PlainSpring.inside)
            out[0] = -0.5 * self.stiffness * (inp[2] + inp[3])
            out[1], out[2] = 0.0, 0.5 * self.stiffness * inp[3] ** 2
            PlainSpring.inside[0] -= 1
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
def small() -> klack.CaseOnHand:
    return klack.load_case(SMALL)


@pytest.fixture(scope="module")
def rod(tmp_path_factory: pytest.TempPathFactory) -> klack.CaseOnHand:
    file = tmp_path_factory.mktemp("rod") / "rod.yaml"
    file.write_text(ROD)
    return klack.load_case(file)


def drawn(count: int) -> list[Point]:
    """Points over the working range; some omit a key, one touches a film, one a list."""
    rng = np.random.default_rng(17)
    points: list[Point] = [
        {PRELOAD: f"{rng.uniform(8.0, 20.0)!r} N", GAP: f"{rng.uniform(60.0, 140.0)!r} um"}
        for _ in range(count)
    ]
    points[1] = {GAP: "80 um"}
    points[2] = {"network.components.opening.film.roughness": "0.5 um"}
    points[3] = {"network.components.magnet.force.1": "40 N", "run.step": "40 ns"}
    return points


def single(
    case: klack.CaseOnHand, point: Point, variant: str, measures: Sequence[str]
) -> list[float]:
    """Measures of one stroke of the changed case."""
    for key, value in point.items():
        case = case.with_value(key, value)
    found = klack.run_stroke(case, [variant]).measures
    values = []
    for name in measures:
        stop, _, key = name.rpartition(".")
        of = f"{variant}, {stop.replace('.', ' ')}" if stop else variant
        number = found[of][key].value if of in found else None
        values.append(float("nan") if number is None else float(number))
    return values


def matrix(table: klack.PointTable) -> np.ndarray:
    return np.column_stack([column.values for column in table.measures])


class TestSameBits:
    @pytest.mark.slow
    @pytest.mark.parametrize("variant", ["wet", "dry"])
    def test_threads_and_order_change_no_bit(self, small: klack.CaseOnHand, variant: str):
        points = drawn(8)
        truth = np.array([single(small, point, variant, MEASURES) for point in points])
        assert np.isfinite(truth[:, :6]).all()
        assert len({*truth[:, 0]}) == len(points)
        for threads, order in ((1, range(8)), (2, [5, 0, 7, 3, 2, 6, 1, 4]), (4, range(7, -1, -1))):
            shuffled = [points[i] for i in order]
            table = klack.run_many(small, shuffled, MEASURES, variant=variant, threads=threads)
            np.testing.assert_array_equal(matrix(table), truth[list(order)])
            assert not table.failed.any()

    @pytest.mark.slow
    def test_geometry_and_damping_take_the_general_way(self, rod: klack.CaseOnHand):
        """A longer needle, another damping and other modes beside points of the given one."""
        points: list[Point] = [
            {PRELOAD: "6 N"},
            {LENGTHS[0]: 25.0, LENGTHS[1]: 25.0, PRELOAD: "6 N"},
            {DAMPING: "5 %"},
            {"reduction.modes.needle.count": 3},
            {LENGTHS[0]: 25.0, LENGTHS[1]: 25.0, PRELOAD: "4 N"},
            {},
        ]
        measures = ("opening_time", "opening.1.peak_force", "energy_throughput")
        table = klack.run_many(rod, points, measures, threads=2)
        truth = np.array([single(rod, point, "dry", measures) for point in points])
        np.testing.assert_array_equal(matrix(table), truth)
        assert len({*truth[:, 1]}) == len(points)

    def test_python_is_called_by_one_thread(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
        (tmp_path / "plain_spring_of_many.py").write_text(PLAIN)
        monkeypatch.syspath_prepend(tmp_path)
        from plain_spring_of_many import PlainSpring  # type: ignore[import-not-found]

        text = SMALL.read_text().replace("duration: 2 ms, step: 20 ns", "duration: 0.4 ms")
        text = text.replace(
            "    magnet:",
            "    own: {type: 'plain_spring_of_many:PlainSpring', stiffness: 1 N/mm}\n    magnet:",
        ).replace("spring.end,", "spring.end, own.end,")
        (tmp_path / "own.yaml").write_text(text)
        case = klack.load_case(tmp_path / "own.yaml", [PlainSpring])
        points: list[Point] = [
            {"network.components.own.stiffness": f"{k} N/mm"} for k in (1.0, 5.0, 20.0)
        ]
        table = klack.run_many(case, points, ["opening_time"], variant="dry", threads=3)
        truth = [single(case, point, "dry", ["opening_time"]) for point in points]
        np.testing.assert_array_equal(matrix(table), truth)
        assert PlainSpring.inside == [0, 1]
        sys.modules.pop("plain_spring_of_many")

    @pytest.mark.slow
    def test_every_point_has_an_fmu_of_its_own(
        self, tmp_path: Path, spring_damper_fmu: Callable[..., Path]
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
        case = klack.load_case(tmp_path / "own.yaml")
        points: list[Point] = [{PRELOAD: "10 N"}, {PRELOAD: "12 N"}, {PRELOAD: "14 N"}]
        measures = ["opening_time_at_50_percent", "energy_throughput"]
        with allowed("simulate_network", 1e-6):  # explicit coupling
            table = klack.run_many(case, points, measures, threads=3)
            truth = [single(case, point, "dry", measures) for point in points]
        np.testing.assert_array_equal(matrix(table), truth)
        assert not table.failed.any()

    def test_parts_that_are_kept_make_the_same_case(self, small: klack.CaseOnHand):
        """Truth: the case read as a whole."""
        tree = small.tree
        assert isinstance(small.checked, klack.api.ValveCase)
        points = points_of(small.checked, tree, drawn(8))
        parts = checked_parts(tree, small.checked, [key.place for key in points.keys])
        for i in range(len(points)):
            changes = points.changes(i)
            assert case_at(ValveCase, tree, parts, changes) == case_at(
                ValveCase, tree, tree, changes
            )


class TestFailures:
    def test_a_failing_point_is_a_row(self, small: klack.CaseOnHand):
        """Refused by the case, unable to start, and stopped on its way; the others are as alone."""
        points: list[Point] = [
            {PRELOAD: "12 N"},
            {"network.components.needle.mass": "-3 g"},
            {"network.components.chamber.volume": "0.2 mm^3"},
            {PRELOAD: "13 N"},
        ]
        table = klack.run_many(small, points, MEASURES, variant="wet", threads=2)
        assert table.failed.tolist() == [False, True, True, False]
        assert "network.components.needle.mass" in table.failures[1]
        assert "got '-3 g', expected a value above 0" in table.failures[1]
        with pytest.raises(KlackError) as raised:
            single(small, points[2], "wet", MEASURES)
        assert table.failures[2] == str(raised.value)
        assert np.isnan(matrix(table)[[1, 2]]).all()
        for i in (0, 3):
            assert matrix(table)[i].tolist() == single(small, points[i], "wet", MEASURES)

    def test_doubts_of_a_point_stay_with_it(self, small: klack.CaseOnHand):
        points: list[Point] = [{PRELOAD: "12 N"}, {PRELOAD: "60 N"}, {PRELOAD: "14 N"}]
        table = klack.run_many(small, points, ["impacts"], variant="wet", threads=3)
        alone = klack.run_stroke(small.with_value(PRELOAD, "60 N"), ["wet"]).record.warnings
        assert any("never left its seat" in note for note in alone)
        assert list(table.warnings[1]) == list(alone)
        assert not any("never left" in note for i in (0, 2) for note in table.warnings[i])

    @pytest.mark.parametrize(
        ("points", "measures", "words"),
        [
            ([{"network.components.spring.preloat": "1 N"}], ["impacts"], "mean 'preload'"),
            ([{PRELOAD: "1 mm"}], ["impacts"], "a length"),
            ([{PRELOAD: 12.0}], ["impacts"], "without unit"),
            ([{PRELOAD: ["12 N"]}], ["impacts"], "one value"),
            ([{PRELOAD: None}], ["impacts"], "one value"),
            ([PRELOAD], ["impacts"], "a mapping of key to value"),
            (PRELOAD, ["impacts"], "a mapping of key to value"),
            ({PRELOAD: "12 N"}, ["impacts"], "a list with a value"),
            ({PRELOAD: ["1 N"], GAP: ["1 um", "2 um"]}, ["impacts"], "different lengths"),
            ([{"network.fluid.gas_fraction": "1 %"}], ["impacts"], "'network.fluid: n-heptane'"),
            ([{"network.components.spring": "none", PRELOAD: "1 N"}], ["impacts"], "contain"),
            ([{"": "1"}], ["impacts"], "keys joined"),
            ([{"run.variants.0": "wet"}], ["impacts"], "a single variant"),
            (
                [
                    {"network.components.magnet.force.1": "4 N"},
                    {"network.components.magnet.force.01": "5 N"},
                ],
                ["impacts"],
                "in two ways",
            ),
            ([], ["opening_tim"], "mean 'opening_time'"),
            ([], ["seat.peak_forse"], "mean 'seat.peak_force'"),
            ([], ["seat.0.peak_force"], "one of"),
            ([], ["seet.peak_force"], "mean 'seat.peak_force'"),
            ([], [], "no measure"),
            ([], [None], "one of"),
        ],
    )
    def test_what_is_misspelt_is_one_error_before_any_run(
        self,
        small: klack.CaseOnHand,
        points: list[Point],
        measures: list[str],
        words: str,
        monkeypatch: pytest.MonkeyPatch,
    ):
        monkeypatch.setattr("klack.analyses.study.strokes.one_variant", None)
        with pytest.raises(InputError, match=words):
            klack.run_many(small, points, measures)

    def test_a_variant_or_a_case_that_is_not_there_is_refused(self, small: klack.CaseOnHand):
        with pytest.raises(InputError, match="one of: wet"):
            klack.run_many(small, [], ["impacts"], variant="we")
        with pytest.raises(InputError, match="only impacts have levels"):
            klack.run_many(small, [], ["impacts"], level="reduced")
        with pytest.raises(InputError, match="only strokes have variants"):
            klack.run_many("two-rods", [], ["peak_force"], variant="dry")
        for threads in (0, True):
            with pytest.raises(InputError, match="1 or more"):
                klack.run_many(small, [], ["impacts"], threads=threads)

    def test_strokes_that_do_not_fit_into_memory_are_refused(
        self, small: klack.CaseOnHand, monkeypatch: pytest.MonkeyPatch
    ):
        from klack.machine.memory import AvailableMemory

        monkeypatch.setattr(
            "klack.machine.memory.available_memory", lambda: AvailableMemory(size=2e8, bound="test")
        )
        assert len(klack.run_many(small, drawn(4), ["impacts"], threads=2)) == 4
        with pytest.raises(InputError, match="fewer threads"):
            klack.run_many(small, drawn(8), ["impacts"], threads=8)


class TestInterruption:
    @pytest.mark.slow
    def test_rows_so_far_are_kept(self, small: klack.CaseOnHand):
        points = drawn(8)

        def progress(stage: str, fraction: float) -> None:
            if stage == "points" and fraction >= 3 / 8:
                raise KeyboardInterrupt

        with pytest.raises(klack.RunsInterrupted) as raised:
            klack.run_many(small, points, MEASURES, variant="wet", threads=2, progress=progress)
        table = raised.value.table
        assert isinstance(raised.value, KeyboardInterrupt)
        assert len(table) == 8
        done = ~table.failed
        assert 3 <= done.sum() < 8
        assert {table.failures[i] for i in np.flatnonzero(table.failed)} == {NOT_COMPUTED}
        for i in np.flatnonzero(done):
            assert matrix(table)[i].tolist() == single(small, points[i], "wet", MEASURES)

    @pytest.mark.skipif(sys.platform == "win32", reason="signals")
    @pytest.mark.slow
    def test_ctrl_c_ends_all_threads_soon(self):
        """Of a process with thousands of points left."""
        script = f"""
import signal, klack
signal.signal(signal.SIGINT, signal.default_int_handler)  # a suite in the background ignores it
points = {{{PRELOAD!r}: ["12 N", "13 N"] * 5000}}
def progress(stage, fraction):
    if stage == "points" and fraction > 0.0:
        print("runs", flush=True)
try:
    klack.run_many({str(SMALL)!r}, points, ["impacts"], threads=2, progress=progress)
except klack.RunsInterrupted as stop:
    print("done", int((~stop.table.failed).sum()), len(stop.table), flush=True)
"""
        command = [sys.executable, "-c", script]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == "runs\n"
            process.send_signal(signal.SIGINT)
            last = process.stdout.read().splitlines()[-1].split()
            assert process.wait(60) == 0
        assert last[0] == "done"
        assert 0 < int(last[1]) < int(last[2]) == 10_000

    def test_an_error_of_the_progress_ends_all_threads(self, small: klack.CaseOnHand):
        import threading

        def progress(stage: str, fraction: float) -> None:
            if stage == "points" and fraction > 0.0:
                raise ZeroDivisionError

        before = threading.active_count()
        with pytest.raises(ZeroDivisionError):
            klack.run_many(small, drawn(8), ["impacts"], threads=4, progress=progress)
        assert threading.active_count() == before


@pytest.fixture(scope="module")
def table(small: klack.CaseOnHand) -> klack.PointTable:
    points = {PRELOAD: ["12 N", "-3 N"], "network.components.needle.mass": ["3 g", "-1 g"]}
    return klack.run_many(small, points, ["opening_time", "seat.peak_force"], variant="dry")


class TestTable:
    def test_columns_are_in_si(self, table: klack.PointTable):
        assert table[PRELOAD].tolist() == [12.0, -3.0]
        assert table["network.components.needle.mass"].tolist() == [0.003, -0.001]
        assert [column.unit for column in table.columns] == ["N", "kg", "s", "N", "1", "1"]
        assert table.measures[0].measure.definition
        with pytest.raises(InputError, match="mean 'opening_time'"):
            table["opening_tim"]

    def test_it_goes_to_csv_pandas_and_arrays(self, table: klack.PointTable, tmp_path: Path):
        rows = list(csv.reader(table.to_csv(tmp_path / "t.csv").read_text().splitlines()))
        assert rows[0][0] == f"{PRELOAD} [N]"
        assert float(rows[1][2]) == table["opening_time"][0]
        assert rows[2][2:4] == ["", ""]
        frame = pytest.importorskip("pandas") and table.to_pandas()
        assert frame["opening_time"].tolist()[0] == table["opening_time"][0]
        assert frame.attrs["units"]["opening_time"] == "s"
        assert table.arrays()["failure"].tolist() == list(table.failures)
        assert rows[0][-2:] == ["failure", "doubts"]

    def test_it_goes_to_parquet_with_units(self, table: klack.PointTable, tmp_path: Path):
        """Truth: the same numbers, bit for bit; equal tables make equal files."""
        parquet = pytest.importorskip("pyarrow.parquet")
        found = parquet.read_table(table.to_parquet(tmp_path / "t.parquet"))
        assert found["opening_time"].to_numpy()[0] == table["opening_time"][0]
        assert np.isnan(found["opening_time"].to_numpy()[1])
        assert found["failure"].to_pylist() == list(table.failures)
        assert found.schema.field(PRELOAD).metadata == {b"unit": b"N"}
        assert found.schema.metadata[b"variant"] == b"dry"
        again = table.to_parquet(tmp_path / "again.parquet").read_bytes()
        assert again == (tmp_path / "t.parquet").read_bytes()

    def test_it_can_be_read(self, table: klack.PointTable):
        text = repr(table)
        assert "small_valve, dry: 2 points, 1 without measures" in text
        assert "needle.mass: got" in text
        assert "<table>" in table._repr_html_()
        assert max(map(len, text.splitlines())) < 400

    def test_no_points_make_an_empty_table(self, small: klack.CaseOnHand):
        for none in ([], {}, {PRELOAD: []}):
            table = klack.run_many(small, none, ["opening_time"])
            assert len(table) == 0
            assert table["opening_time"].shape == (0,)
            assert "0 points" in repr(table)

    def test_many_points_are_shown_in_short(self, small: klack.CaseOnHand):
        table = klack.run_many(small, [{PRELOAD: "12 N"}] * 12, ["impacts"], variant="dry")
        assert "and 2 more" in repr(table)
        assert len({*table["impacts"]}) == 1
        assert json.dumps(table["impacts"].tolist())
