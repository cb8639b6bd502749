"""Derivatives of ``demo-stroke``, wet: what they cost beside strokes, and how well they predict.

``uv run --group dev python benchmarks/sensitivities.py`` prints the table: for 3, 6 and 20
parameters the processor time of all derivatives over that of one stroke, the least of several
rounds, and the deviations of the check.
"""

import argparse

import klack

__all__ = ["main"]

NETWORK = "network.components."
KEYS = tuple(
    NETWORK + key
    for key in (
        *("spring.preload", "spring.stiffness", "guide.coulomb", "opening.gap"),
        *("opening.film.cut_off", "coil.resistance", "guide.viscous"),
        *("opening.film.inner_radius", "opening.film.outer_radius", "seat.film.width"),
        *("seat.film.mean_radius", "driver.boost_voltage", "driver.peak_current"),
        *("driver.hold_current", "armature_gap.clearance", "bores.diameter", "nozzle.diameter"),
        *("upper.volume", "inlet.volume", "supply.pressure"),
    )
)
MEASURES = ("opening_time", "opening.peak_force", "opening.impulse", "seat.peak_force")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    rounds = parser.parse_args().rounds
    print("parameters  over a stroke  " + "  ".join(MEASURES))
    for count in (3, 6, 20):
        records = [
            klack.sensitivities("demo-stroke", parameters=KEYS[:count], measures=MEASURES)
            for _ in range(rounds)
        ]
        strokes = min(record.run_time for record in records)
        ratio = min(record.runs_time for record in records) / strokes
        found = [f"{100.0 * (item.deviation or 0.0):.2g} %" for item in records[0].measures]
        print(f"{count:10d}  {ratio:13.1f}  " + "  ".join(found))


if __name__ == "__main__":
    main()
