"""Write record_synthetic.csv for the tutorial on stairs: ``python make_record.py``.

No record of such a valve exists, so this one is SYNTHETIC: the case computed in steps four times as
fine, seen by a lift sensor of 100 kHz with 0.1 um of noise and a vibrometer of 200 kHz with 5 mm/s.
The random numbers have a fixed seed.
"""

from pathlib import Path

import numpy as np

from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import read_valve_case
from klack.case.reader import find_case
from klack.measurement.channels import LiftSensor
from klack.measurement.lift_sensor import sense

LIFT = LiftSensor(bandwidth=100e3), 0.1e-6  # [Hz], rms per sample [m]
VELOCITY = LiftSensor(bandwidth=200e3), 5e-3  # [Hz], [m/s]


def main() -> None:
    """One stroke, a million samples a second."""
    path = find_case("stairs")
    text = path.read_text(encoding="utf-8")
    fine = text.replace("run:\n", "run:\n  accuracy: fine\n")
    study = run_stroke(read_valve_case(fine, path), variants=["wet"])
    result = study.variants["wet"].result
    time = np.arange(0.0, result.time[-1], 1e-6)
    random = np.random.default_rng(11)
    columns = [time]
    for name, (sensor, noise) in (("needle.tip displacement", LIFT), ("needle velocity", VELOCITY)):
        values = result.channels[name].values
        seen = sense(result.time, values - values[0], sensor)
        columns.append(
            np.interp(time, result.time, seen) + noise * random.standard_normal(time.size)
        )
    lines = [
        "# SYNTHETIC: computed by make_record.py, not measured.",
        "time,lift,velocity",
        "ms,um,m/s",
    ]
    for t, lift, speed in zip(*columns, strict=True):
        lines.append(f"{1e3 * t:.3f},{1e6 * lift:.2f},{speed:.4f}")
    Path("record_synthetic.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"record_synthetic.csv: {time.size} samples, SYNTHETIC")


if __name__ == "__main__":
    main()
