"""Make the synthetic measurements of ``cases/measured``: ``python docs/synthetic_strokes.py``.

No public record of such a valve exists, so these stand in for one.  They are computed by klack and
labelled SYNTHETIC in their names and headers:

- ``strokes_synthetic.csv``: ten wet strokes behind each other, lift, current and pressure;
- ``dry_strokes_synthetic.csv``: six dry ones of the same valve, lift and current;
- ``drops_synthetic.csv``: fifty dry drops of the valve of ``cases/demo-shots``, one column each;
- ``truth.yaml``: the hidden values in SI; for the tests, nothing else reads it.

With names, only those are made: ``python docs/synthetic_strokes.py drops``.  All random numbers
have fixed seeds, so that the files come out the same again.
"""

import sys
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from klack import __version__
from klack.analyses.shots.draw import ShotDraw, draw_shot
from klack.analyses.shots.model import build_shots
from klack.analyses.shots.one_shot import ShotSetup, run_shot
from klack.analyses.stroke.run import run_variant, variant_network
from klack.assembling.valve import Valve, build_valve
from klack.case.levels import Variant
from klack.case.reader import parse, shipped_cases, text_of, validated
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.measurement.channels import LiftSensor
from klack.measurement.lift_sensor import sense

Floats = NDArray[np.float64]

FOLDER = Path(__file__).resolve().parents[1] / "cases" / "measured"

# Hidden values in SI by the name of the parameter of the calibration.  None is the nominal one.
TRUTH = {
    "preload": 13.57,
    "friction": 0.68,
    "film_gap": 0.97e-6,
    "damping": 0.029,
    "offset": 3.4e-6,
}
UNITS = {"preload": "N", "friction": "N", "film_gap": "m", "damping": "", "offset": "m"}
SCATTER = {"preload": 0.003, "friction": 0.05}
"""Relative standard deviation from stroke to stroke; all others stay."""

STEP, RECORD = "10 ns", "0.2 us"  # of the computation; the case takes 20 ns
RATE = 400e3  # [1/s] of the recorder
REST = 0.31373e-3  # [s] closed valve before each stroke, no multiple of a sample
LIFT_NOISE, CURRENT_NOISE, PRESSURE_NOISE = 1e-6, 0.02, 2e3  # rms per sample: m, A, Pa
DRIFT = 0.6e-6  # [m] largest value of the slow drift of the lift


@dataclass(frozen=True, kw_only=True)
class Bench:
    """One long record of one variant.

    Parameters
    ----------
    variant : str
    file : str
    title : str
    strokes : int
        Even: the hidden values of two strokes lie on both sides of those of all.
    duration : str
        Of one stroke, until the needle rests again.
    pressure : bool
        Whether a pressure was recorded.
    seed : int
    """

    variant: Variant
    file: str
    title: str
    strokes: int
    duration: str
    pressure: bool
    seed: int


WET = Bench(
    variant="wet",
    file="strokes_synthetic.csv",
    title="10 strokes in n-heptane at 5 bar",
    strokes=10,
    duration="6 ms",
    pressure=True,
    seed=5101,
)
DRY = Bench(
    variant="dry",
    file="dry_strokes_synthetic.csv",
    title="6 dry strokes of the same valve",
    strokes=6,
    duration="9 ms",
    pressure=False,
    seed=5102,
)


def main(names: Sequence[str]) -> None:
    """Make the files that are asked for, all of them without names."""
    wanted = set(names) or {"wet", "dry", "drops", "truth"}
    if "truth" in wanted:
        lines = [f"{name}: {value!r}" for name, value in TRUTH.items()]
        (FOLDER / "truth.yaml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    if wanted & {"wet", "dry"}:
        valve = build_valve(_case(TRUTH, WET))
        for bench in (WET, DRY):
            if bench.variant in wanted:
                write_bench(bench, valve)
    if "drops" in wanted:
        write_drops()


# --------------------------------------------------------------------------- strokes


def write_bench(bench: Bench, valve: Valve) -> None:
    """Compute all strokes of a bench and write what its recorder would have seen."""
    random = np.random.default_rng(bench.seed)
    hidden = _antithetic(random, bench.strokes)
    time, channels = _back_to_back(bench, valve, hidden)
    sample = np.arange(0.0, time[-1], 1.0 / RATE)
    sensor = _sensor(valve.case)
    shown = {name: np.interp(sample, time, values) for name, values in channels.items()}
    shown["lift"] = np.interp(sample, time, sense(time, channels["lift"], sensor))
    shown["lift"] += DRIFT * np.sin(2.0 * np.pi * sample / sample[-1])
    noise = {"lift": LIFT_NOISE, "current": CURRENT_NOISE, "pressure": PRESSURE_NOISE}
    shown = {name: x + noise[name] * random.standard_normal(len(x)) for name, x in shown.items()}
    heads = [("Time", "ms", 1e3, 4), ("Needle_Lift", "um", 1e6, 2), ("I_Coil", "A", 1.0, 3)]
    columns = [sample, shown["lift"], shown["current"]]
    if bench.pressure:
        heads.append(("P_Inlet", "bar", 1e-5, 3))
        columns.append(shown["pressure"])
    _write_csv(FOLDER / bench.file, _stroke_header(bench), heads, columns)


def _case(values: Mapping[str, float], bench: Bench) -> ValveCase:
    """Case of the measured valve with other values and with the finer step."""
    path = FOLDER / "case.yaml"
    text = text_of(path)
    data, lines = parse(text, path)
    data = deepcopy(data)
    keys = data.pop("calibration")["parameters"]
    for name, value in values.items():
        _put(data, keys[name]["key"], f"{value!r} {UNITS[name]}".strip())
    data["run"] |= {"step": STEP, "record": RECORD, "duration": bench.duration}
    return validated(ValveCase, text, path, data, lines)


def _put(data: Any, key: str, value: str) -> None:
    *path, last = key.split(".")
    for part in path:
        data = data[part]
    data[last] = value


def _antithetic(random: np.random.Generator, strokes: int) -> list[dict[str, float]]:
    """Hidden values of each stroke; each pair lies evenly about those of all."""
    drawn: list[dict[str, float]] = []
    for _ in range(strokes // 2):
        away = {name: share * random.standard_normal() for name, share in SCATTER.items()}
        for sign in (1.0, -1.0):
            values = {name: TRUTH[name] * (1.0 + sign * share) for name, share in away.items()}
            drawn.append(TRUTH | values)
    return [drawn[i] for i in random.permutation(strokes)]


def _back_to_back(
    bench: Bench, valve: Valve, hidden: Sequence[Mapping[str, float]]
) -> tuple[Floats, dict[str, Floats]]:
    """True motion of all strokes on one time axis: a rest before each."""
    parts: list[dict[str, Floats]] = []
    step = 0.0
    for values in hidden:
        # none of the scattered values changes a mesh or a mode
        case = _case(values, bench)
        network = valve.network.with_components(_scattered(valve, case))
        one = replace(valve, case=case, network=network)
        result = run_variant(case, variant_network(one, bench.variant).rows())
        lift = result.channels["needle.tip displacement"].values
        part = {"lift": lift - lift[0], "current": result.channels["coil current"].values}
        if bench.pressure:
            part["pressure"] = result.channels["inlet pressure"].values
        step = float(result.time[1] - result.time[0])  # whole coarse steps of the computation
        quiet = round(REST / step)
        parts.append({name: np.append(np.full(quiet, x[0]), x[:-1]) for name, x in part.items()})
    channels = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return step * np.arange(len(channels["lift"])), channels


def _scattered(valve: Valve, case: ValveCase) -> dict[str, Any]:
    components = case.network.network().components
    return {name: components[name] for name in ("spring", "guide")}


def _sensor(case: ValveCase) -> LiftSensor:
    if case.measurement is None:
        raise SystemExit("the case of the measured valve has no section 'measurement'")
    return case.measurement.sensor


def _stroke_header(bench: Bench) -> list[str]:
    scatter = ", ".join(f"{name} {100 * share:g} %" for name, share in SCATTER.items())
    return [
        f"SYNTHETIC: {bench.title}, computed, not measured.",
        f"Made by docs/synthetic_strokes.py with klack {__version__}, seed {bench.seed}: variant",
        f"{bench.variant} of cases/measured/case.yaml with hidden values, in steps of {STEP}.",
        f"Scatter from stroke to stroke (1 sigma): {scatter}.",
        "Lift: displacement of the tip of the needle, by a sensor of 50 kHz (first order) with an",
        f"offset and a drift of up to {1e6 * DRIFT:g} um.",
        f"White noise per sample: lift {1e6 * LIFT_NOISE:g} um, current {1e3 * CURRENT_NOISE:g} mA"
        + (f", pressure {1e-5 * PRESSURE_NOISE:g} bar (absolute)." if bench.pressure else "."),
    ]


# --------------------------------------------------------------------------- drops

DROPS, DROP_SEED = 50, 5103
DROP_RATE, DROP_SPAN = 250e3, 1.1e-3  # [1/s], [s] after first touch
DROP_BEFORE = 0.24e-3  # [s] of the fall
DROP_NOISE = 0.2e-6  # [m] rms: a range of some 100 um only
FINE = 0.2e-6  # [s] for the sensor
# Scatter of the drops, other than in the case: that of a real valve is unknown.
DROP_VALUES = {
    "clearance": "4.6 um",
    "force": {"normal": ["6.1 N", "0.1 N"]},
    "friction": {"uniform": [0.09, 0.17]},
    "waviness": {"uniform": ["0.03 um", "0.12 um"]},
}


def write_drops() -> None:
    """Fifty drops of the valve of ``cases/demo-shots``, whose scatter is not that of the case."""
    case = _drop_case()
    model = build_shots(case, lambda stage, fraction: None)
    random = np.random.default_rng(DROP_SEED)
    sample = np.arange(0.0, DROP_BEFORE + DROP_SPAN, 1.0 / DROP_RATE)
    columns: list[Floats] = [sample]
    sensor = LiftSensor(bandwidth=50e3)
    for index in range(DROPS):
        draw = draw_shot(case, DROP_SEED, index, model.touch_height)
        # first touch stands somewhere between two samples
        touch = DROP_BEFORE + random.uniform(-0.5, 0.5) / DROP_RATE
        fine = np.arange(0.0, sample[-1] + FINE, FINE)
        height = _height(model.setup, draw, fine - touch)
        seen = np.interp(sample, fine, sense(fine, height, sensor))
        columns.append(seen + DROP_NOISE * random.standard_normal(len(sample)))
    heads = [("time", "us", 1e6, 0)]
    heads += [(f"drop_{i + 1:02d}", "um", 1e6, 2) for i in range(DROPS)]
    _write_csv(FOLDER / "drops_synthetic.csv", _drop_header(), heads, columns)


def _drop_case() -> Case:
    path = shipped_cases()["demo-shots"]
    text = text_of(path)
    data, lines = parse(text, path)
    data = deepcopy(data)
    shots = data["shots"]
    data["guide"]["clearance"] = DROP_VALUES["clearance"]
    shots["force"], shots["friction"] = DROP_VALUES["force"], DROP_VALUES["friction"]
    shots["waviness"]["rms"] = DROP_VALUES["waviness"]
    shots["step"], shots["impacts"] = "20 ns", 6
    return validated(Case, text, path, data, lines)


def _height(setup: ShotSetup, draw: ShotDraw, since_touch: Floats) -> Floats:
    """Height of the centre of mass of one drop, before and after first touch [m]."""
    outcome = run_shot(setup, draw)
    height = np.interp(since_touch, setup.trace_time, outcome.height.astype(float))
    before = since_touch < 0.0
    speed = outcome.numbers["approach_speed"]
    height[before] = _fall(setup, since_touch[before], speed, draw.force)
    return height


def _fall(setup: ShotSetup, time: Floats, speed: float, force: float) -> Floats:
    """Height [m] at times before first touch, below a spring that was compressed so far."""
    mass, stiffness = setup.model.mass, setup.spring_stiffness

    def rate(_: float, state: Floats) -> list[float]:
        return [float(state[1]), -(force + stiffness * state[0]) / mass]

    # backwards from first touch
    solved = solve_ivp(rate, (0.0, time[0]), [0.0, -speed], t_eval=time[::-1], rtol=1e-10)
    return np.asarray(solved.y[0][::-1])


def _drop_header() -> list[str]:
    return [
        f"SYNTHETIC: {DROPS} dry drops of the valve of cases/demo-shots, computed, not measured.",
        f"Made by docs/synthetic_strokes.py with klack {__version__}, seed {DROP_SEED}: interface",
        "level in steps of 20 ns, with a hidden scatter of eccentricity, tilt, preload, friction",
        "and roundness that is not that of the case.",
        "Height of the centre of mass of the needle above first touch, by a sensor of 50 kHz",
        f"(first order); white noise of {1e6 * DROP_NOISE:g} um per sample.",
    ]


# --------------------------------------------------------------------------- file


def _write_csv(
    path: Path,
    comments: Sequence[str],
    heads: Sequence[tuple[str, str, float, int]],
    columns: Sequence[Floats],
) -> None:
    """Comments, a row of names, a row of units, numbers."""
    lines = [f"# {line}" for line in comments]
    lines.append(",".join(name for name, *_ in heads))
    lines.append(",".join(unit for _, unit, *_ in heads))
    printed = [
        [f"{factor * value:.{digits}f}" for value in column]
        for (_, _, factor, digits), column in zip(heads, columns, strict=True)
    ]
    lines += [",".join(row) for row in zip(*printed, strict=True)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"{path}: {path.stat().st_size / 1e3:.0f} kB, {len(columns[0])} rows")


if __name__ == "__main__":
    main(sys.argv[1:])
