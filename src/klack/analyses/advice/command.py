"""Command ``klack advise``."""

import os
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from klack.errors import InputError, refuse_if
from klack.terminal.options import WANTED, CaseArgument, Components, Wanted, imported
from klack.terminal.progress import show_progress

__all__ = ["advise"]

_MOST_ERROR = 0.2
_MOST_LEVEL = 20.0

_UpTo = Annotated[
    str | None,
    Parameter(
        name="--up-to",
        help="Highest frequency that matters, e.g. '40 kHz'. [default: third octaves of the "
        "case's own force within 40 dB of the strongest]",
    ),
]
_Error = Annotated[
    str,
    Parameter(
        name="--error",
        help="Accepted error of peak force, contact time and force history, e.g. '1 %'.",
    ),
]
_Bands = Annotated[
    str, Parameter(name="--bands", help="Accepted error of every third octave, e.g. '1 dB'.")
]
_Level = Annotated[
    str | None,
    Parameter(
        name="--level",
        help="reduced or interface: level whose results are to meet the target. [default: "
        "reduced; interface if off-axis]",
    ),
]
_Write = Annotated[
    Path | None,
    Parameter(name="--write", help="Write the case with the advice to this new file."),
]


def advise(
    case: CaseArgument,
    /,
    *,
    up_to: _UpTo = None,
    error: _Error = "1 %",
    bands: _Bands = "1 dB",
    level: _Level = None,
    write: _Write = None,
    confirm: Annotated[
        bool, Parameter(help="Run the advised case and compare it with the finest run.")
    ] = True,
    component: Components = None,
    wanted: Wanted = WANTED,
) -> int:
    """Advise mesh sizes, modes and step of a case, with the error expected of each."""
    from klack.units import FREQUENCY, RATIO, parse_quantity

    _require_new_file(write)
    limit = _within("--error", error, parse_quantity(error, RATIO, "--error"), _MOST_ERROR, "1 %")
    decibel = _within("--bands", bands, _decibel(bands), _MOST_LEVEL, "1 dB")
    highest = None if up_to is None else parse_quantity(up_to, FREQUENCY, "--up-to")

    from klack.case.any_case import read_any_case, read_case_tree

    tree = read_case_tree(case, imported(component))
    checked = read_any_case(tree.text, tree.path, tree.components.values())

    from klack import __version__
    from klack.analyses.advice.advised_case import (
        advice_yaml,
        advise_case,
        advised_text,
        changed_values,
    )
    from klack.analyses.advice.analysis import ADVICE, AdvisedCase

    with show_progress(wanted.quiet) as progress:
        advice = advise_case(
            checked,
            error=limit,
            level_error=decibel,
            up_to=highest,
            level=level,
            confirm=confirm,
            progress=progress,
            threads=wanted.threads,
        )
    if write is not None:
        _write_whole(write, advised_text(tree, advice, write, __version__))
    advised = AdvisedCase(
        advice=advice,
        changes=changed_values(tree, advice),
        yaml=advice_yaml(tree, advice),
        written=write,
    )
    wanted.show(ADVICE.told(advised))
    wanted.write(lambda: ADVICE.to_json(advised))
    return 0


def _within(option: str, text: str, value: float, most: float, example: str) -> float:
    if 0.0 < value <= most:
        return value
    unit = example.split()[1]
    shown = 100.0 * most if unit == "%" else most
    raise InputError(
        option,
        got=f"'{text}'",
        expected=f"above 0 and at most {shown:g} {unit}",
        hint=f"write the value with its unit: '{example}'.",
    )


def _decibel(text: str) -> float:
    number = text.strip().removesuffix("dB").strip()
    try:
        return float(number)
    except ValueError:
        raise InputError(
            "--bands", got=f"'{text}'", expected="a level in dB", hint="write '1 dB'."
        ) from None


def _require_new_file(path: Path | None) -> None:
    if path is None:
        return
    refuse_if(
        path.exists(),
        f"--write {path}",
        got="a file that exists",
        expected="the name of a new file",
        hint="choose another name; the case itself is never changed.",
    )
    folder = path.absolute().parent
    refuse_if(
        not folder.is_dir() or not os.access(folder, os.W_OK),
        f"--write {path}",
        got="a folder that does not exist or is not writable",
        expected="a file in an existing folder",
        hint="create the folder first.",
    )


def _write_whole(path: Path, text: str) -> None:
    from klack.files.whole import whole_file

    with whole_file(path) as new:
        new.write_text(text, encoding="utf-8")
