"""Cases shipped with klack."""

from pathlib import Path

from klack.errors import InputError
from klack.input.problem import nearest, one_of

__all__ = ["find_case", "shipped_cases"]


def shipped_cases() -> dict[str, Path]:
    """Names and files of the shipped cases: ``<name>/case.yaml``.

    In an installed package they lie in ``klack/cases``, in a checkout in ``cases`` at its root.
    """
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "cases", package.parents[1] / "cases"):
        if folder.is_dir():
            return {path.parent.name: path for path in sorted(folder.glob("*/case.yaml"))}
    return {}


def find_case(text: str | Path) -> Path:
    """Find a case by its path, by a folder that holds ``case.yaml``, or by its shipped name."""
    path = Path(text)
    if path.is_file():
        return path
    if (path / "case.yaml").is_file():
        return path / "case.yaml"
    cases = shipped_cases()
    if str(text) in cases:
        return cases[str(text)]
    raise InputError(
        str(text),
        got="a folder without case.yaml" if path.is_dir() else "neither a file nor a shipped case",
        expected=f"a case file (YAML), or one of the shipped cases: {one_of(cases)}",
        hint=nearest(str(text), cases, "check the spelling and the folder."),
    )
