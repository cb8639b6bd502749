"""What ``--json`` writes against its published schema, without a key that the schema leaves out."""

import copy
import json
from functools import cache
from types import SimpleNamespace
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from klack.analyses.json_results import result_schema
from klack.terminal import output

__all__ = ["every_result_is_documented", "require_documented"]


@cache
def _validator() -> Draft202012Validator:
    """Validator that knows every key: the published schema lets newer versions add some."""
    schema = copy.deepcopy(result_schema())
    Draft202012Validator.check_schema(schema)
    for definition in schema["$defs"].values():
        definition.setdefault("additionalProperties", False)
    return Draft202012Validator(schema)


def require_documented(result: Any) -> None:
    """Fail for a key that is missing, not documented, or of another type than documented."""
    names = [reference["$ref"].split("/")[-1] for reference in _validator().schema["oneOf"]]
    definitions = _validator().schema["$defs"]
    mine = [n for n in names if definitions[n]["properties"]["schema"]["const"] == result["schema"]]
    assert len(mine) == 1, result["schema"]
    own = Draft202012Validator({"$ref": f"#/$defs/{mine[0]}", "$defs": definitions})
    problems = [f"{error.json_path}: {error.message}" for error in own.iter_errors(result)]
    assert not problems, problems


@pytest.fixture(autouse=True)
def every_result_is_documented(monkeypatch: pytest.MonkeyPatch) -> None:
    """Check each result before it is written."""

    def dumps(data: Any, **options: Any) -> str:
        if "$schema" not in data:
            require_documented(json.loads(json.dumps(data)))
        return json.dumps(data, **options)

    monkeypatch.setattr(output, "json", SimpleNamespace(dumps=dumps))
