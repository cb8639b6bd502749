"""Bodies that left klack come back by a case: the impact is the same."""

import numpy as np
import pytest

from klack.assembling.given_bodies import reduced_from_file
from klack.case import load_case
from klack.case.any_case import load_any_case
from klack.case.reader import find_case
from klack.exchange.case_models import case_models
from klack.exchange.matlab_model import write_matlab
from klack.exchange.text_model import write_text

CASE = """
klack: 1
title: there and back
bodies:
  needle:
    reduced: {{kind: {kind}, file: {needle}, units: m kg s, ports: {{tip: {needle_port}}}}}
  seat:
    reduced: {{kind: {kind}, file: {seat}, units: m kg s, ports: {{face: {seat_port}}}}}
contact:
  between: [needle.tip, seat.face]
  gap: 0 um
  local_law: {{kind: linear, stiffness: 1e9 N/m}}
run: {{levels: [reduced], duration: 40 us}}
motion: {{speed: 0.5 m/s}}
"""


@pytest.fixture(scope="module")
def models():
    return case_models(load_any_case(find_case("demo-valve-axisymmetric")))


@pytest.mark.parametrize("form", ["mat", "state_space.csv", "modes.csv"])
def test_bodies_come_back(tmp_path, models, form):
    bodies = models.body_models()
    write = write_matlab if form == "mat" else write_text
    write(bodies, tmp_path)
    ending = ".mat" if form == "mat" else f"_{form}"
    names = {
        key: f"{{input: force_{port}, output: displacement_{port}}}"
        if form != "modes.csv"
        else f"{{input: {port}}}"
        for key, port in (("needle_port", "contact"), ("seat_port", "contact"))
    }
    text = CASE.format(
        kind="modal" if form == "modes.csv" else "state-space",
        needle=f"needle{ending}",
        seat=f"housing{ending}",
        **names,
    )
    path = tmp_path / "back.yaml"
    path.write_text(text)
    case = load_case(path)
    for name, old in (("needle", models.bodies[0]), ("seat", models.bodies[1])):
        new = reduced_from_file(case, name)
        assert new.mode_count == old.mode_count
        np.testing.assert_allclose(new.omega, old.omega, rtol=1e-8)
        shapes = abs(old.port_shapes[:, 0])
        np.testing.assert_allclose(
            abs(new.port_shapes[:, 0]), shapes, rtol=1e-6, atol=1e-6 * shapes.max()
        )
