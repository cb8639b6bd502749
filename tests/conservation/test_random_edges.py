"""Truth: energy is conserved with any sensible notched spool, needle edge or pneumatic valve.

The draws are those of ``benchmarks/random_edges.py``, which runs as many as wanted.
"""

import numpy as np
import pytest
from draws import program

from klack.errors import InputError

pytestmark = pytest.mark.slow

DRAWS = program("random_edges")

# 45, 57: a face joined to a pressure source, whose work was missing from the energy balance
SAMPLE = (*range(6), 7, 9, 45, 57)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("seed", SAMPLE)
def test_a_random_edge_runs_and_keeps_its_energy(seed):
    result = DRAWS["run"](DRAWS["draw"](seed))

    assert result.books.relative_residual <= 1e-11
    # the implicit step of a room: what its curved law gives back, 4e-11 seen
    assert result.books.least_loss >= -1e-10 * result.books.scale
    assert all(np.isfinite(data.values).all() for data in result.channels.values())


@pytest.mark.filterwarnings("ignore")
def test_a_room_that_the_stroke_uses_up_is_refused_before_the_run():
    with pytest.raises(InputError, match=r"(?s)components\.room\.volume.*Try: "):
        DRAWS["run"](DRAWS["draw"](41))
