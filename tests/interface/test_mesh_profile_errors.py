"""Faulty profiles: the error names the edge and says what to do."""

import pytest

from klack.errors import InputError
from klack.mesh.profile import Arc, Line, Profile


def make(*edges: Line | Arc) -> Profile:
    return Profile((0, 0), edges)


@pytest.mark.parametrize(
    ("edges", "text"),
    [
        ((Line((1, 0)), Line((1, 1), "lid")), r"edge 2 'lid'.*an end at .*closes the profile"),
        ((Line((1, 0)),), "1 edges"),
        ((Line((1, 0)), Line((1, float("nan"))), Line((0, 0))), "not finite"),
        ((Line((1, 0)), Line((-1, 1), "left"), Line((0, 0))), "'left'.*r >= 0"),
        (
            (Line((1, 0)), Arc((0, 1), (0.2, 0), "round"), Line((0, 0))),
            r"'round': got a centre 800 mm from the start and 1019.8 mm from the end",
        ),
        (
            (Line((2, 0)), Line((0, 2), "x"), Line((2, 2), "y"), Line((0, 0), "z")),
            r"edges 2 'x' and 4 'z': got a common point at \(1000, 1000\) mm",
        ),
        (
            (Line((2, 0), "a"), Line((2, 1)), Line((1, 0), "c"), Line((0, 1)), Line((0, 0))),
            "got a common point at",
        ),
        ((Line((1, 0)), Line((1, 0), "nothing"), Line((1, 1)), Line((0, 0))), "without length"),
        ((Line((3, 0)), Arc((3, 2), (3, 1), "half"), Line((0, 0))), "half circle.*clockwise"),
    ],
    ids=["open", "one edge", "nan", "left", "radius", "crossing", "touch", "length", "half"],
)
def test_faulty_profile_is_explained(edges, text):
    with pytest.raises(InputError, match=f"(?s){text}"):
        make(*edges)


def test_arc_through_a_line_is_found():
    """A half circle that bulges through the opposite side."""
    with pytest.raises(InputError, match=r"'bulge' and 3 'side'"):
        Profile(
            (2, 0),
            (
                Arc((2, 4), (2, 2), "bulge", clockwise=True),
                Line((1, 4)),
                Line((1, 0), "side"),
                Line((2, 0)),
            ),
        )


def test_unknown_surface_name_lists_the_known_ones():
    body = make(Line((1, 0), "foot"), Line((0, 1), "cone"), Line((0, 0), "axis"))

    with pytest.raises(InputError, match="one of: foot, cone"):
        body.surface_area("axis")
