"""The page on magnetic networks: the numbers of its example."""

from pathlib import Path

import pytest
import yaml

from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import load_valve_case

CASE = Path(__file__).parents[2] / "docs" / "how-to" / "own_magnet.yaml"


@pytest.mark.parametrize(("bridge", "opens"), [(True, 0.358), (False, 0.302)])
def test_the_bridge_takes_flux(tmp_path, bridge, opens):
    case = yaml.safe_load(CASE.read_text(encoding="utf-8"))
    if not bridge:
        del case["network"]["components"]["magnet"]["elements"]["bridge"]
    (tmp_path / "case.yaml").write_text(yaml.safe_dump(case), encoding="utf-8")

    stroke = run_stroke(load_valve_case(tmp_path / "case.yaml")).variants["dry"]

    assert 1e3 * stroke.opening_time == pytest.approx(opens, abs=5e-4)
    assert abs(stroke.result.books.relative_residual) < 1e-12
    assert {"magnet flux", "magnet flux of leakage"} <= set(stroke.result.channels)
