"""Files of a linearisation: matrices for other programs, eigenvalues and responses as CSV."""

import csv
from collections.abc import Iterable, Sequence
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from klack.analyses.linearisation.record import LinearModel, LoopMargins, Response

__all__ = ["write_files"]


def write_files(record: LinearModel, folder: Path) -> tuple[str, ...]:
    """Write all of them into a folder; returns their names."""
    content = _content(record)
    np.savez_compressed(folder / "linear-model.npz", **content)
    cells = {
        key: np.array(value, dtype=object) if key in _WORDS else value
        for key, value in content.items()
    }
    scipy.io.savemat(
        folder / "linear-model.mat",
        {"klack": cells},
        long_field_names=True,
        oned_as="column",
        do_compression=True,
    )
    names = ["linear-model.npz", "linear-model.mat"]
    states, inputs, outputs = (
        [x.name for x in signals] for signals in (record.states, record.inputs, record.outputs)
    )
    for key, matrix, down, across in (
        ("A", record.A, states, states),
        ("B", record.B, states, inputs),
        ("C", record.C, outputs, states),
        ("D", record.D, outputs, inputs),
    ):
        names.append(f"{key}.csv")
        rows = ([name, *map(repr, row)] for name, row in zip(down, matrix.tolist(), strict=True))
        _write(folder / names[-1], ["", *across], rows)
    names.append("eigenvalues.csv")
    _write(
        folder / names[-1],
        [
            "verdict", "real [1/s]", "imaginary [1/s]", "uncertainty [1/s]", "frequency [Hz]",
            "damping ratio", "time constant [s]", *record.owners,
        ],
        (
            [
                mode.verdict,
                *map(
                    repr,
                    (mode.real, mode.imaginary, mode.uncertainty, mode.frequency, mode.damping,
                     mode.time_constant),
                ),
                *map(repr, record.shares[k].tolist()),
            ]
            for k, mode in enumerate(record.eigenvalues)
        ),
    )  # fmt: skip
    if record.responses or record.loops:
        names.append("frequency-response.csv")
        _write_responses(record, folder / names[-1])
    for swept in record.sweeps:
        names.append("stability.csv")
        columns = (swept.values, swept.unstable, swept.growth, swept.frequency, swept.damping)
        _write(
            folder / names[-1],
            [
                f"{swept.name} [{swept.unit}]", "unstable eigenvalues", "growth [1/s]",
                "frequency [Hz]", "damping ratio", "failure",
            ],
            (
                [*(repr(c[i].item()) for c in columns), " ".join(swept.failures[i].split())]
                for i in range(len(swept.values))
            ),
        )  # fmt: skip
    return tuple(names)


_WORDS = ("states", "state_units", "inputs", "input_units", "outputs", "output_units")


def _content(record: LinearModel) -> dict[str, Any]:
    """Matrices and names, as they are in every format."""
    signals = {"state": record.states, "input": record.inputs, "output": record.outputs}
    return {
        "A": record.A,
        "B": record.B,
        "C": record.C,
        "D": record.D,
        "E": np.eye(len(record.states)),
        "eigenvalues": np.array([complex(x.real, x.imaginary) for x in record.eigenvalues]),
        "delays": record.delays,
        "band": np.array(record.band),
        **{f"{kind}s": np.array([x.name for x in found]) for kind, found in signals.items()},
        **{f"{kind}_units": np.array([x.unit for x in found]) for kind, found in signals.items()},
    }


def _write(file: Path, head: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    file.write_text(text.getvalue(), encoding="utf-8", newline="")


def _write_responses(record: LinearModel, file: Path) -> None:
    """Magnitude and phase of every response and loop over the same frequencies."""
    columns: list[tuple[str, Any]] = []
    axis = (record.responses or record.loops)[0].frequency
    curves: list[tuple[str, str, Response | LoopMargins]] = [
        *((f"{x.target.name} over {x.source.name}", x.unit, x) for x in record.responses),
        *((f"open loop at {x.name}", "1", x) for x in record.loops),
    ]
    for name, unit, curve in curves:
        values = curve.real + 1j * curve.imaginary
        columns.append((f"{name} magnitude [{unit}]", np.abs(values)))
        columns.append((f"{name} phase [degrees]", np.degrees(np.unwrap(np.angle(values)))))
    _write(
        file,
        ["frequency [Hz]", *(name for name, _ in columns)],
        ([repr(float(f)), *(repr(float(c[k])) for _, c in columns)] for k, f in enumerate(axis)),
    )
