"""``klack cache``: truth = the folder as it is, and the exit codes that the command promises."""

import json

import pytest

from klack.cache.entry import Entry
from klack.cache.result_cache import result_cache
from klack.cli.main import main


@pytest.fixture
def filled(tmp_path, monkeypatch):
    monkeypatch.setenv("KLACK_CACHE", str(tmp_path / "cache"))
    for n in range(3):
        result_cache().store(f"{n:064x}", Entry(arrays={}, text="x" * 1000))
    return tmp_path / "cache"


@pytest.mark.slow
def test_it_says_where_how_many_and_how_large(filled, capsys):
    assert main(["cache", "--json", "-"]) == 0

    out, words = capsys.readouterr()
    size = sum(path.stat().st_size for path in filled.glob("*.entry"))
    assert json.loads(out) == {
        "schema": "klack-cache/1",
        "folder": str(filled),
        "count": 3,
        "size_B": size,
        "limit_B": 5_000_000_000,
    }
    assert str(filled) in words
    assert "3, 3.47 kB of at most 5 GB" in words


def test_clear_deletes_the_results_and_nothing_else(filled, capsys):
    (filled / "mine.txt").write_text("mine")

    assert main(["cache", "--clear"]) == 0

    assert "Deleted 3 results, 3.47 kB" in capsys.readouterr().out
    assert sorted(path.name for path in filled.iterdir()) == ["CACHEDIR.TAG", "mine.txt"]
    assert main(["cache", "--clear"]) == 0
    assert "Deleted 0 results" in capsys.readouterr().out


def test_an_absent_folder_is_empty_and_not_made(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("KLACK_CACHE", str(tmp_path / "none"))

    assert main(["cache"]) == 0

    assert "Results: 0" in capsys.readouterr().out
    assert not (tmp_path / "none").exists()


def test_off_is_said(monkeypatch, capsys):
    monkeypatch.setenv("KLACK_CACHE", "off")

    assert main(["cache", "--json", "-"]) == 0

    out, words = capsys.readouterr()
    assert json.loads(out)["folder"] is None
    assert "off" in words


def test_a_wrong_size_is_bad_input(monkeypatch, capsys):
    monkeypatch.setenv("KLACK_CACHE", "somewhere")
    monkeypatch.setenv("KLACK_CACHE_SIZE", "plenty")

    assert main(["cache"]) == 2

    assert "KLACK_CACHE_SIZE: got 'plenty'" in capsys.readouterr().err
