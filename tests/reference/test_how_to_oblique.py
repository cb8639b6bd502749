"""The page on oblique impacts: its case gives the numbers that it prints, and those measured."""

import pytest
from pages import HOW_TO, blocks

from klack.analyses.impact.run import run_impact
from klack.case.reader import load_case


@pytest.mark.slow
def test_the_case_of_the_page():
    """Kharaz, Gorham & Salman 2001 measured 0.6876 at 30.1 degrees and 613 rad/s at 31.2."""
    case = load_case(HOW_TO / "oblique_impact.yaml")
    motion = run_impact(case, levels=["interface"], certify=False).levels["interface"].oblique
    assert motion is not None
    page = (HOW_TO / "oblique-impact.md").read_text(encoding="utf-8")
    row = blocks(page, "text")[0].splitlines()[1].split()
    assert motion.tangential_restitution == pytest.approx(float(row[1]), abs=1e-3)
    assert motion.spin_after[1] == pytest.approx(float(row[6]), rel=2e-3)
    assert motion.tangential_restitution == pytest.approx(0.6876, abs=5e-3)
    assert motion.spin_after[1] == pytest.approx(613.0, rel=0.02)
