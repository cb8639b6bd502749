"""The page on maps of a magnet: its example against the magnetic circuit that made the table."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import load_valve_case

CASE = Path(__file__).parents[2] / "docs" / "how-to" / "magnet_from_a_map.yaml"
CIRCUIT = """
type: solenoid
turns: 60
resistance: 0.8 ohm
gap: 120 um
residual_gap: 30 um
poles:
  - {inner_radius: 2 mm, outer_radius: 3.5 mm, fringing: none}
  - {inner_radius: 5 mm, outer_radius: 6 mm, fringing: none}
iron: [{material: X6Cr17, length: 30 mm, area: 20 mm^2}]
"""


def stroke(path):
    return run_stroke(load_valve_case(path)).variants["dry"]


def test_the_map_opens_and_closes_like_the_circuit(tmp_path):
    case = yaml.safe_load(CASE.read_text(encoding="utf-8"))
    case["network"]["components"]["coil"] = yaml.safe_load(CIRCUIT)
    (tmp_path / "case.yaml").write_text(yaml.safe_dump(case), encoding="utf-8")

    from_map, from_circuit = stroke(CASE), stroke(tmp_path / "case.yaml")

    # 12 gaps: the splines are within 0.3 % of the force
    assert from_map.opening_time == pytest.approx(from_circuit.opening_time, rel=1e-3, abs=0.0)
    assert from_map.closing_time == pytest.approx(from_circuit.closing_time, rel=2e-3, abs=0.0)
    found = [(run.opening_time, run.closing_time) for run in (from_map, from_circuit)]
    assert np.round(1e3 * np.array(found), 3).tolist() == [[0.885, 1.739], [0.885, 1.740]]
    assert abs(from_map.result.books.relative_residual) < 1e-12
