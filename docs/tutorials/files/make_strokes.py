"""Write strokes_synthetic.csv for the tutorial on measurements: ``python make_strokes.py``.

No record of this armature exists, so this one is SYNTHETIC: computed from case.yaml with hidden
values, then given scatter from stroke to stroke, a sensor of 50 kHz and noise.  Strokes come in
pairs that lie evenly on both sides of the hidden values.  The random numbers have a fixed seed.
"""

import re
from pathlib import Path

import numpy as np

from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import read_valve_case
from klack.measurement.channels import LiftSensor
from klack.measurement.lift_sensor import sense

HIDDEN = {"preload: 8 N": 8.35, "coulomb: 0.4 N": 0.62, "restitution: 0.5": 0.43}
SCATTER = {"preload: 8 N": 0.004, "coulomb: 0.4 N": 0.04, "restitution: 0.5": 0.01}
STROKES, NOISE = 6, 0.5e-6  # [m] rms per sample
SENSOR = LiftSensor(bandwidth=50e3)


def stroke(text: str, away: dict[str, float], time: np.ndarray) -> np.ndarray:
    """Lift of one stroke [m] as the sensor sees it, ``away`` from the hidden values."""
    for nominal, value in HIDDEN.items():
        key, _, unit = re.fullmatch(r"(\w+): ([\d.]+) ?(\w*)", nominal).groups()
        text = text.replace(nominal, f"{key}: {value * (1 + away[nominal]):.6f} {unit}".strip())
    study = run_stroke(read_valve_case(text, Path("hidden.yaml")))
    result = study.variants["dry"].result
    lift = result.channels[study.channels.lift].values
    return np.interp(time, result.time, sense(result.time, lift - lift[0], SENSOR))


def main() -> None:
    """One column for each stroke, 250 000 samples a second."""
    text = Path("case.yaml").read_text(encoding="utf-8")
    random = np.random.default_rng(7)
    time = np.arange(0.0, 5e-3, 4e-6)
    strokes = []
    for _ in range(STROKES // 2):
        away = {key: share * random.standard_normal() for key, share in SCATTER.items()}
        strokes += [stroke(text, away, time)]
        strokes += [stroke(text, {key: -share for key, share in away.items()}, time)]
    seen = [lift + NOISE * random.standard_normal(len(time)) for lift in strokes]
    lines = ["# SYNTHETIC: computed by make_strokes.py with hidden values, not measured."]
    lines.append(",".join(["time", *(f"lift_{i + 1}" for i in range(STROKES))]))
    lines.append(",".join(["ms"] + ["um"] * STROKES))
    for t, *row in zip(1e3 * time, *(1e6 * lift for lift in seen), strict=True):
        lines.append(",".join([f"{t:.4f}", *(f"{x:.2f}" for x in row)]))
    Path("strokes_synthetic.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
