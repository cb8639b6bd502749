"""The help of every command shows an example; truth: the parser, and the cases that exist."""

import shlex

import pytest

from klack.case import find_case
from klack.cli.commands import COMMANDS, parser
from klack.cli.main import main


@pytest.mark.parametrize(
    ("command", "example"), COMMANDS.items(), ids=[command.__name__ for command in COMMANDS]
)
def test_the_example_can_be_typed(command, example, capsys):
    name = command.__name__
    assert main([name, "--help"]) == 0
    assert " ".join(capsys.readouterr().out.split("Example:")[-1].split("╭")[0].split()) == example

    first, *words = shlex.split(example)
    found, bound, _ = parser.parse_args(words, print_error=False, exit_on_error=False)

    assert (first, words[0]) == ("klack", name)
    assert found is command
    if "case" in bound.arguments:
        assert find_case(bound.arguments["case"]).is_file()
