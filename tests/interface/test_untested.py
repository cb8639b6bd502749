"""A machine without a compiler leaves out the tests of the C core, and the run says so."""

import c_compiler

from klack.errors import InputError


def test_a_missing_compiler_is_reported(monkeypatch):
    def none(platforms):
        raise InputError("x", got="no C compiler for it", expected="one", hint="install one.")

    monkeypatch.setattr(c_compiler, "require_compilers", none)
    monkeypatch.setattr(c_compiler.shutil, "which", lambda name: None)

    first, second = c_compiler.untested()

    assert first.startswith("C core not tested: no C compiler")
    assert "gcc is not installed" in second


def test_nothing_is_reported_where_all_is_there(monkeypatch):
    monkeypatch.setattr(c_compiler, "require_compilers", lambda platforms: None)
    monkeypatch.setattr(c_compiler.shutil, "which", lambda name: "/usr/bin/gcc")

    assert c_compiler.untested() == []
