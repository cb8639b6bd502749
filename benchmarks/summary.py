"""A run as one page: machine, numbers against goals, figures."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from figures import draw_figures
from number import Number, number_of

__all__ = ["write_summary"]


def write_summary(folder: Path, result: dict[str, Any]) -> None:
    """Write ``summary.md`` and the figures that it shows.

    Parameters
    ----------
    folder : Path
        Made where it is not there.
    result : dict
        As in ``numbers.json``.
    """
    folder.mkdir(parents=True, exist_ok=True)
    numbers = [number_of(name, entry) for name, entry in result["numbers"].items()]
    figures = draw_figures(folder, numbers)
    lines = ["# Benchmarks of klack", "", _machine(result), ""]
    goals = [number for number in numbers if number.goal is not None]
    if goals:
        missed = sum(not number.met for number in goals)
        lines += ["## Goals", "", f"{len(goals) - missed} met, {missed} missed.", ""]
        lines += [*_table(sorted(goals, key=lambda n: bool(n.met)), goal=True), ""]
    for file, caption in figures.items():
        lines += [f"![{caption}]({file})", "", caption, ""]
    for part, about in result["parts"].items():
        own = [number for number in numbers if number.part == part]
        lines += [
            f"## {part}",
            "",
            f"{about['seconds']:g} s, load {about['load']:g} at its start.",
            "",
        ]
        lines += [*_table(own, goal=False), ""] if own else [about.get("left_out", "nothing"), ""]
    (folder / "summary.md").write_text("\n".join(lines))


def _machine(result: dict[str, Any]) -> str:
    about = result["machine"]
    versions = ", ".join(f"{name} {version}" for name, version in about["versions"].items())
    return (
        f"{about['time']}, commit {about['commit']}, size {result['size']}. {about['processor']}, "
        f"{about['cores']} cores, {about['memory_GB']} GB, {about['system']}, Python "
        f"{about['python']}; {versions}."
    )


def _table(numbers: Sequence[Number], *, goal: bool) -> list[str]:
    head = "| what | measured | unit | goal | accuracy beside it |"
    lines = [head, "|---|---:|---|---|---|"]
    for number in numbers:
        verdict = number.verdict.replace("MISSED", "**missed**")
        lines.append(
            f"| {number.name} | {number.value:.4g} | {number.unit} | {verdict} | {number.beside} |"
        )
    if not goal and not any(number.goal is not None for number in numbers):
        lines = ["|".join(_without_goal(line)) for line in lines]
    return lines


def _without_goal(line: str) -> list[str]:
    cells = line.split("|")
    return [*cells[:4], *cells[5:]]
