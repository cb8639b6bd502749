"""Whatever a test of a command writes with --json is compared with the schema of its command."""

from json_schema_check import every_result_is_documented  # noqa: F401
