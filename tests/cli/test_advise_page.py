"""The page about advice: its first command runs, its table is what comes out (change detector)."""

import json
import re
from pathlib import Path

import pytest

from klack.case import load_case
from klack.cli.main import main

PAGE = (Path(__file__).parents[2] / "docs/how-to/advise.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_command_and_table_of_the_page(capsys):
    """Expected errors within half of what the page says: meshes differ between machines."""
    (command, *_) = re.findall(r"```\nklack (.*?)\n```", PAGE, re.DOTALL)
    assert main([*command.split(), "--no-confirm"]) == 0

    told = json.loads(Path("advice.json").read_text())
    case = load_case(Path("finer.yaml"))
    assert not told["meets_target"]["now"]
    assert told["meets_target"]["advised"]
    assert case.bodies["housing"].mesh.size < 1e-3
    head = "| setting | in the case | advised | order | expected error now | with the advice |\n"
    rows = PAGE.split(head)[1].split("\n\n")[0].splitlines()[1:]
    page = {cells[1]: cells[5] for cells in ([c.strip() for c in r.split("|")] for r in rows)}
    found = {item["name"]: item["error"]["now"] for item in told["settings"]}
    assert set(found) < set(page)
    for name, error in found.items():
        percent = 100 * max(error[k] for k in ("peak_force", "contact_time", "force_history"))
        if not page[name].startswith("<"):
            said = float(page[name].split(" %")[0])
            assert percent == pytest.approx(said, rel=0.5, abs=0.02), name


def test_options_of_the_page_are_those_of_the_command(capsys):
    assert main(["advise", "--help"]) == 0
    text = capsys.readouterr().out
    table = PAGE.split("| option |")[1].split("\n\n")[0]
    for option in re.findall(r"`(--[a-z-]+)", table):
        assert option in text
