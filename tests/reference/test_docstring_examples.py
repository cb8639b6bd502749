"""Every example in a docstring of klack prints what it says.

Truth: the output that stands below the example.  Only files with examples are imported, and only
when their turn comes: klack has ten times as many.
"""

import doctest
import importlib
import re
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "src"
MODULES = [
    ".".join(path.relative_to(SOURCE).with_suffix("").parts)
    for path in sorted((SOURCE / "klack").rglob("*.py"))
    if re.search(r"^ *>>> ", path.read_text("utf-8"), re.MULTILINE)
]


@pytest.mark.parametrize("module", MODULES)
def test_examples_print_what_they_say(module, as_for_a_user):
    said: list[str] = []
    runner = doctest.DocTestRunner(verbose=False, optionflags=doctest.ELLIPSIS)
    for example in doctest.DocTestFinder(exclude_empty=True).find(importlib.import_module(module)):
        runner.run(example, out=said.append)

    assert not said, "".join(said)
    assert runner.tries > 0, f"{module} has >>>, and no example in a docstring"
