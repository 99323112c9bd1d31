"""What is no JSON, or more than JSON, is refused with one sentence."""

from __future__ import annotations

import json

import pytest

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.store import json_reader
from pytest_drive_robust.store.json_reader import read_json


def test_what_json_holds_comes_back(tmp_path):
    (tmp_path / "a.json").write_text('{"a": [1, 2.5, null, "é"]}', encoding="utf-8")
    assert read_json(tmp_path / "a.json", name="it") == {"a": [1, 2.5, None, "é"]}


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"", "it is not valid JSON: Expecting value"),
        (b"\xff", "it is not valid JSON: 'utf-8' codec"),
        (b"[-Infinity]", "it is not valid JSON: -Infinity is not a number in JSON."),
        (b'[{"a": 1, "b": 2, "a": 3}]', "it is not valid JSON: 'a' stands there twice, as after a merge"),
        (b"1" * 5000, "it is not valid JSON: "),
        (b'{"a":' * 100_000, "it is not valid JSON: "),
    ],
    ids=lambda value: str(value[:12]),
)
def test_anything_else_is_refused(tmp_path, content, told):
    (tmp_path / "a.json").write_bytes(content)
    with pytest.raises(UsageError) as refused:
        read_json(tmp_path / "a.json", name="it")
    assert str(refused.value).startswith(told)
    assert "\n" not in str(refused.value)


def test_a_file_that_is_missing_or_huge_is_refused(tmp_path, monkeypatch):
    with pytest.raises(UsageError, match="it cannot be read: No such file or directory"):
        read_json(tmp_path / "a.json", name="it")
    monkeypatch.setattr(json_reader, "_LARGEST_BYTES", 10)
    (tmp_path / "a.json").write_text(json.dumps("x" * 10))
    with pytest.raises(UsageError, match="it is larger than 1 GiB"):
        read_json(tmp_path / "a.json", name="it")
