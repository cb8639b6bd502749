"""Points on rings against solids of the same half sections, which know nothing of Fourier orders.

Truth: compliance order by order of the swept bodies, and off-axis impacts of swept bodies.
"""

from pathlib import Path

import pytest
import yaml

from klack.analyses.impact.run import run_impact
from klack.case import load_case
from klack.verification.ring_bodies import NeedleOnRing, solid_over_ring_compliance

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def pair():
    return NeedleOnRing(size=60e-6, bulk=4e-3)


@pytest.mark.parametrize("number", [0, 1], ids=["needle", "seat"])
@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_compliance_of_each_order_is_that_of_the_solid(pair, number, order):
    """Waves of pressure cos n t on the same hats, which are triangles on the solid.

    What that leaves falls as the square of n over the layers: 2e-3 in order 1.
    """
    solid, rings = solid_over_ring_compliance(pair, number=number, order=order, layers=12)
    assert rings == pytest.approx(solid, rel=2e-4 + 3.5e-3 * order**2)


def coarse_case(folder, model, friction=0.0, eccentricity="0.5 um", tilt="0.02 deg"):
    """The needle of the how-to page on shots, whose elements are as wide as the contact."""
    text = (Path(__file__).parents[2] / "docs/how-to/guided_needle.yaml").read_text("utf-8")
    case = yaml.safe_load(text)
    del case["guide"], case["shots"]
    for body in case["bodies"].values():
        body["geometry"]["model"] = model
        body["geometry"]["layers"] = 24
        if model == "axisymmetric":
            del body["geometry"]["layers"]
    case["run"] = {"duration": "40 us", "levels": ["interface"]}
    case["contact"]["friction"] = friction
    placement = {"eccentricity": eccentricity, "tilt": tilt, "tilt_direction": "50 deg"}
    case["motion"] = {"speed": "0.3 m/s", "placement": placement}
    path = folder / f"{model}.yaml"
    path.write_text(yaml.safe_dump(case), encoding="utf-8")
    return load_case(path)


@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_an_off_axis_impact_is_that_of_the_swept_solid(tmp_path, friction):
    """The solid tends to the rings with its layers.

    1.3 % off with 8 of them, 0.5 % with 12, 0.3 % with 16, 0.02 % with 24.
    """
    ring, solid = (
        run_impact(
            coarse_case(tmp_path, model, friction), levels=["interface"], certify=False
        ).levels["interface"]
        for model in ("axisymmetric", "swept")
    )
    ours, theirs = ring.measures, solid.measures
    assert ours.peak_force == pytest.approx(theirs.peak_force, rel=3e-3)
    assert ours.contact_time == pytest.approx(theirs.contact_time, rel=2e-3)
    assert ours.restitution == pytest.approx(theirs.restitution, abs=1e-3)
    assert abs(ring.energy_residual) < 1e-10
    if friction:
        assert ring.energies["friction"] == pytest.approx(solid.energies["friction"], rel=0.01)
