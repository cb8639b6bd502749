"""Truth: each random valve out of the whole catalogue ends in an answer or in words.

The draws are those of ``benchmarks/random_catalogue.py``, which runs as many as wanted.
"""

from collections import Counter

import pytest
from draws import program

from klack.network.catalogue import type_words

DRAWS = program("random_catalogue")


@pytest.mark.slow
def test_every_component_type_is_drawn():
    found = Counter(
        word for seed in range(200) for word in set(DRAWS["draw"](seed, "damper.fmu").types)
    )

    assert {word: found[word] for word in type_words() if found[word] < 5} == {}


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("coil: the gap is -17 um at 711.68 us, far outside its range.\nTry: a longer gap.", True),
        ("before, at the start: the pressures find no steady flow.\nTry: state them.", True),
        ("the forces at the ports did not converge at 711.68 us.\nTry: a smaller step.", False),
        ("coil: the gap is -17 um, far outside its range.\nTry: a longer gap.", False),
        ("coil: the gap is -17 um at 711.68 us.", False),
    ],
)
def test_a_stopped_run_has_to_say_where_when_and_what_to_try(words, told):
    tells = DRAWS["tells_where_and_when"]

    assert tells(f"Note: before\nklack stroke: {words}", ("coil", "before")) is told


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("seed", range(0, 36, 3))
def test_a_random_valve_ends_in_an_answer_or_in_words(seed, tmp_path):
    end, words = DRAWS["ending"](DRAWS["written"](DRAWS["draw"](seed), tmp_path), more=True)

    assert end in ("answer", "note", "error", "stopped"), words  # "stopped" as told above
