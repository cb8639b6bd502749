"""Measured strokes and sound: ``uv run --group dev python benchmarks/sound_and_measurement.py``.

- *restitution*: of noisy bouncing records (1 um, sensor of 50 kHz), three sets of 16 records each;
- *calibrate*: five parameters from the ten shipped synthetic strokes, with their hidden values;
- *noise*: from the stored stroke of demo-stroke to loudness, warm and in a fresh process;
- *file*: an MDF4 file of one gigabyte, cut into strokes, with the largest memory of the process.

``--only NAME`` takes one part, ``--json FILE`` writes ``{name: {value, unit, goal}}``.  Ten minutes
and 2.5 GB of disk together.  Parts that need a fresh process start one.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

CASES = Path(__file__).resolve().parents[1] / "cases"
FILE_SIZE = 1.07e9  # [bytes]
RATE, PERIOD = 1e6, 10e-3  # samples per second and [s] from stroke to stroke, of the large file


@dataclass(frozen=True)
class Row:
    """One measured number."""

    name: str
    value: float
    unit: str
    goal: float | None = None

    def line(self) -> str:
        """As printed."""
        text = f"{self.name:<64}{self.value:>12.4g} {self.unit}"
        if self.goal is None:
            return text
        return f"{text}  goal <= {self.goal:g}  {'ok' if self.value <= self.goal else 'MISSED'}"


# --------------------------------------------------------------------------- restitution


def restitution_rows() -> list[Row]:
    """Deviation of the restitution of the first impact, over noise seeds."""
    from klack.measurement.channels import LiftSensor
    from klack.measurement.impacts import fit_flights
    from klack.measurement.lift_sensor import sense
    from klack.measurement.set_measures import measure_strokes

    sensor = LiftSensor(bandwidth=50e3)
    rows = []
    for speed, pull, restitution in ((0.5, 1250.0, 0.5), (0.5, 2000.0, 0.7), (0.7, 4000.0, 0.6)):
        time, lift = bouncing(speed, pull, restitution, 1e-6)
        shown = sense(time, lift, sensor)
        deviations = []
        for seed in (100, 101, 102):
            random = np.random.default_rng(seed)
            lifts = [shown + random.normal(0.0, 1e-6, time.size) for _ in range(16)]
            read = measure_strokes(
                [fit_flights(time, x, seat=0.0, opening=np.nan, sensor=sensor) for x in lifts]
            )
            hits = [stroke.first("seat") for stroke in read]
            deviations.append(
                [np.nan if hit is None else hit.restitution - restitution for hit in hits]
            )
        name = f"restitution {restitution}, {speed} m/s, {pull:g} m/s^2, 1 MS/s"
        means = np.abs(np.nanmean(deviations, axis=1))
        rows.append(Row(f"{name}: worst mean of a set", float(means.max()), "-", 0.005))
        half = float(np.nanmedian(np.abs(deviations)))
        rows.append(Row(f"{name}: half of the records within", half, "-", 0.005))
    return rows


def bouncing(
    speed: float, pull: float, restitution: float, step: float
) -> tuple[np.ndarray, np.ndarray]:
    """Needle that falls onto its seat with a speed [m/s] and bounces: parabolas, then rest."""
    fall = speed / pull
    time = np.arange(0.0, 1e-3 + 8.0 * fall, step)
    height = 0.5 * speed**2 / pull
    lift = np.where(time < 1e-3, height, height - 0.5 * pull * (time - 1e-3) ** 2)
    begin, up = 1e-3 + fall, restitution * speed
    lift[time >= begin] = 0.0
    while up > 0.02 * speed:
        s = time - begin
        flight = (s >= 0.0) & (s < 2.0 * up / pull)
        lift[flight] = up * s[flight] - 0.5 * pull * s[flight] ** 2
        begin, up = begin + 2.0 * up / pull, restitution * up
    return time, lift


# --------------------------------------------------------------------------- calibrate


def calibrate_rows() -> list[Row]:
    """Wall time of the command, and how many standard errors off the hidden values."""
    truth = dict(
        line.split(":") for line in (CASES / "measured/truth.yaml").read_text().splitlines() if line
    )
    with tempfile.TemporaryDirectory() as folder:
        numbers = Path(folder) / "numbers.json"
        strokes = str(CASES / "measured/strokes_synthetic.csv")
        options = ["--measurement", strokes, "--out", folder, "--no-report", "--quiet"]
        klack("calibrate", str(CASES / "measured"), *options, "--strokes", "2")  # compiles
        begin = perf_counter()
        klack("calibrate", str(CASES / "measured"), *options, "--json", str(numbers))
        wall = perf_counter() - begin
        found = json.loads(numbers.read_text())["parameters"]
    rows = [Row("calibrate: 5 parameters, 10 strokes, 2 profiles", wall, "s", 120.0)]
    for name, value in found.items():
        off = abs(value["value"] - float(truth[name])) / value["standard_error"]
        rows.append(Row(f"calibrate: {name}, off by", off, "standard errors", 2.26))
    return rows


# --------------------------------------------------------------------------- noise


def noise_rows() -> list[Row]:
    """Wall time from a stored stroke to loudness."""
    from klack.analyses.noise.run import run_noise
    from klack.analyses.noise.source import load_sources

    with tempfile.TemporaryDirectory() as folder:
        klack("stroke", str(CASES / "demo-stroke"), "--variant", "wet", "--out", folder, "-q")
        begin = perf_counter()
        klack("noise", folder, "--out", f"{folder}/noise", "--no-report", "-q")
        fresh = perf_counter() - begin
        times = []
        for _ in range(4):
            begin = perf_counter()
            study = run_noise(load_sources(Path(folder)))
            times.append(perf_counter() - begin)
    residual = max(abs(body.residual) for body in study.designs[0].bodies)
    return [
        Row("noise: one stroke, stored result to loudness, warm", min(times), "s", 2.0),
        Row("noise: the command in a fresh process, without report", fresh, "s"),
        Row("noise: energy injected less in the modes and lost", residual, "-", 1e-6),
    ]


# --------------------------------------------------------------------------- a large file


def file_rows() -> list[Row]:
    """Time and memory to cut one gigabyte of MDF4 into strokes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "long.mf4"
        write_mdf(path)
        size = path.stat().st_size
        told = subprocess.run(
            [sys.executable, __file__, "--cut", str(path)], check=True, capture_output=True
        )
        strokes, seconds, memory = json.loads(told.stdout)
    return [
        Row("file: size", size / 1e9, "GB"),
        Row("file: strokes", strokes, "-"),
        Row("file: wall time", seconds, "s"),
        Row("file: largest memory", memory / 1e9, "GB", 2.0),
    ]


def write_mdf(path: Path) -> None:
    """Four channels at 1 MS/s, a stroke every 10 ms."""
    from asammdf import MDF, Signal

    count = int(FILE_SIZE / 40)
    time = np.arange(count) / RATE
    phase = time % PERIOD
    random = np.random.default_rng(1)
    lift = np.where(phase < 3e-3, 80.0 * np.sin(np.pi * phase / 3e-3), 0.0)
    signals = [
        Signal(lift + random.normal(0, 1, count), time, unit="µm", name="lift"),
        Signal(
            np.where(phase < 2.5e-3, 3.0, 0.0) + random.normal(0, 0.01, count),
            time,
            unit="A",
            name="current",
        ),
        Signal(200.0 + random.normal(0, 1, count), time, unit="bar", name="p_rail"),
        Signal(random.normal(0, 100, count), time, unit="m/s^2", name="acceleration"),
    ]
    file = MDF(version="4.10")
    file.append(signals)
    file.save(path, overwrite=True)


def cut(path: Path) -> None:
    """Cut a file into strokes, and print their number, the time [s] and the memory [bytes]."""
    from klack.case.measurement import CaseMeasurement
    from klack.measurement.channels import Trigger
    from klack.measurement.loading import load_stroke_set

    begin = perf_counter()
    section = CaseMeasurement(trigger=Trigger(level="1 A", before=0.5e-3, after=5e-3))
    found = load_stroke_set([path], section)
    seconds = perf_counter() - begin
    memory = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(json.dumps([found.count, seconds, memory]))


# --------------------------------------------------------------------------- all


def klack(*arguments: str) -> None:
    """Run the command in a process of its own."""
    subprocess.run([sys.executable, "-m", "klack", *arguments], check=True, capture_output=True)


PARTS: dict[str, Callable[[], list[Row]]] = {
    "restitution": restitution_rows,
    "calibrate": calibrate_rows,
    "noise": noise_rows,
    "file": file_rows,
}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=PARTS)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--cut", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.cut is not None:
        cut(options.cut)
        return
    rows = []
    for name, part in PARTS.items():
        if options.only in (None, name):
            for row in part():
                print(row.line(), flush=True)
                rows.append(row)
    if options.json is not None:
        table = {r.name: {"value": r.value, "unit": r.unit, "goal": r.goal} for r in rows}
        options.json.write_text(json.dumps(table, indent=2) + "\n")


if __name__ == "__main__":
    main()
