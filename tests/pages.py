"""Pages of the documentation: what they show, what their Python prints, what their cases give."""

import contextlib
import io
import re
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from klack.case import Case, load_case
from klack.case.any_case import load_valve_case
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
HOW_TO = DOCS / "how-to"


def changed_case(folder: Path, page_case: str, *changes: tuple[Any, ...]) -> Case:
    """Case of a page with values in other places, (*keys, value) each; None removes a key."""
    yaml = YAML(typ="safe")
    tree = yaml.load(HOW_TO / page_case)
    for *path, key, value in changes:
        place = tree
        for step in path:
            place = place[step]
        if value is None:
            del place[key]
        else:
            place[key] = value
    with (folder / "case.yaml").open("w", encoding="utf-8") as stream:
        yaml.dump(tree, stream)
    return load_case(folder / "case.yaml")


def blocks(page: str, word: str) -> list[str]:
    """Blocks of a page that are fenced with this word."""
    return re.findall(rf"```{word}\n(.*?)```", page, re.DOTALL)


def numbers(page: str, pattern: str) -> list[float]:
    """Numbers of the groups of a pattern, however the lines of the page are broken."""
    found = re.search(pattern, " ".join(page.split()))
    assert found is not None, pattern
    return [float(number) for number in found.groups()]


def printed(code: str, place: str, names: dict[str, Any] | None = None) -> str:
    """What Python of a page prints."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(code, place, "exec"), {} if names is None else names)
    return out.getvalue()


def require_parts(page: str, case: str) -> None:
    """The parts that a page shows are components of its case."""
    whole = YAML(typ="safe").load(HOW_TO / case)["network"]["components"]
    for block in blocks(page, "yaml-part"):
        for name, part in YAML(typ="safe").load(block).items():
            assert whole[name] == part


def run_of(case: str) -> NetworkResult:
    """Run the network of a case of a page with the steps and the records that it states."""
    found = load_valve_case(HOW_TO / case)
    duration, step, record = found.run.duration, found.run.step, found.run.record
    rows = found.network.network().rows()
    return simulate_network(rows, duration=duration, step=step, record=record)
