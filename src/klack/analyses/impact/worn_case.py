"""The case of an impact with the faces as running-in has left them."""

from pathlib import Path

from klack.analyses.impact.record import RunningIn
from klack.case.any_case import CaseTree
from klack.case.key_path import written_at
from klack.case.reader import parse, read_case
from klack.case.rewriting import moved_files, with_values
from klack.input.problem import Key

__all__ = ["WORN", "worn_text"]

WORN = "worn.yaml"
"""File beside the result."""


def worn_text(text: str, source: Path, found: RunningIn, folder: Path, version: str) -> str:
    """Text of the case with ``contact.worn``, for a file in ``folder``; comments and order stay.

    Parameters
    ----------
    text : str
        Of the case whose impacts have worn the faces.
    source : Path
        Its file.
    found : RunningIn
    folder : Path
    version : str
        Of klack.

    Raises
    ------
    InputError
        Where the layout of the text does not allow it.
    """
    data, lines = parse(text, source)
    tree = CaseTree(path=source, text=text, data=data, lines=lines)
    radius = ", ".join(f"{1e6 * r:.4f} um" for r in found.radius)
    opening = ", ".join(f"{1e9 * w:.4f} nm" for w in found.opening)
    values: dict[Key, str] = {
        ("contact", "worn"): f"{{force: {found.worn_by:.5g} N, "
        f"radius: [{radius}], opening: [{opening}]}}",
    }
    for key, once in ((("run", "impacts"), "1"), (("run", "run_in"), "false")):
        if written_at(data, key) is not None:
            values[key] = once
    state = "run in" if found.run_in else "not yet run in"
    header = (
        f"klack {version}, klack impact: faces of {source.name} after {len(found.peak_force)} "
        f"impacts, {state}.\nTheir set at the {len(found.radius)} contact points of that mesh "
        f"is in contact.worn; they are elastic up to {found.worn_by:.4g} N."
    )
    read_case(with_values(tree, values, header), source)
    return with_values(tree, {**moved_files(tree, folder), **values}, header)
