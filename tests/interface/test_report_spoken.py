"""Charts in words: the numbers are those of the data that the chart draws."""

import pytest

from klack.report.spoken import spoken

AXES = {"xaxis": {"title": {"text": "time [us]"}}, "yaxis": {"title": {"text": "force [N]"}}}


def line(name: str, y: list[float | None], **more: object) -> dict[str, object]:
    return {"type": "scatter", "name": name, "x": list(range(len(y))), "y": y, **more}


def test_each_named_curve_is_told_with_its_extremes_and_gaps_are_left_out():
    told = spoken(
        {
            "data": [
                line("now &amp; <b>then</b>", [0.0, None, 123.456, 5.0]),
                line("", [1.0], showlegend=False),
                line("flat", [2.0, 2.0]),
                line("area", [1.0, 2.0], mode="none"),
            ],
            "layout": AXES,
        }
    )

    assert told == (
        "force [N] over time [us]. now & then: highest 123.5 at 2, lowest 0 at 0, at the end 5. "
        "flat: 2 throughout."
    )


def test_bars_maps_and_parallel_axes_are_told():
    bar = {"type": "bar", "name": "film", "y": ["needle", "stop"], "x": [1.5, None]}
    heat = {"type": "heatmap", "z": [[1.0, 2.0], [-60.0, None]]}
    axis = {"label": "lift [um]", "low": 85.0, "high": 115.0, "values": [85.0, 90.0, 115.0]}

    assert spoken({"data": [bar], "layout": {}}) == "film: needle 1.5."
    assert spoken({"data": [heat], "layout": {}}) == "values: from -60 to 2."
    assert spoken({"axes": [axis]}) == (
        "Parallel axes of 1 quantities for 3 points. lift [um]: from 85 to 115."
    )


@pytest.mark.parametrize("y", [[], [None, None]])
def test_a_curve_without_values_is_left_out(y):
    assert spoken({"data": [line("empty", y)], "layout": AXES}) == "force [N] over time [us]."


def test_long_lists_end_with_how_many_are_left_out():
    told = spoken({"data": [line(f"c{i}", [1.0, 2.0]) for i in range(11)], "layout": AXES})

    assert told.count("highest") == 8
    assert told.endswith("and 3 more.")
