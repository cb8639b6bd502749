"""The page of metering notches says what its case gives; truth of the areas: `klack verify`."""

import re

import numpy as np
import pytest
from pages import HOW_TO, blocks
from ruamel.yaml import YAML

from klack.case.any_case import load_valve_case
from klack.simulation.network_run import simulate_network

PAGE = (HOW_TO / "metering-notches.md").read_text(encoding="utf-8")
CHANNELS = {
    "edge opening": 1e3,
    "edge area": 1e6,
    "edge mass flow": 1e3,
    "edge jet force": 1.0,
    "room pressure": 1e-5,
}


def test_the_page_shows_the_edge_of_the_case():
    whole = YAML(typ="safe").load(HOW_TO / "notched_spool.yaml")
    (block,) = blocks(PAGE, "yaml-part")

    assert YAML(typ="safe").load(block)["edge"] == whole["network"]["components"]["edge"]


def test_the_table_is_that_of_a_run():
    case = load_valve_case(HOW_TO / "notched_spool.yaml")
    run = case.run
    rows = case.network.network().rows()
    result = simulate_network(rows, duration=run.duration, record=run.record)

    table = re.findall(r"^\| ([\d.]+) ms \|(.*)\|$", PAGE, re.MULTILINE)
    assert len(table) == 4
    for time, cells in table:
        place = int(np.argmin(np.abs(result.time - 1e-3 * float(time))))
        for cell, (name, factor) in zip(cells.split("|"), CHANNELS.items(), strict=True):
            told = cell.split()[0]
            digit = 10.0 ** -len(told.partition(".")[2])  # one of the last digit
            found = factor * result.channels[name].values[place]
            assert found == pytest.approx(float(told), rel=0.0, abs=digit), (time, name)
    assert result.books.relative_residual <= 1e-12
