"""`drive-robust comment`: what is put on a pull request. `tests/plugin/test_action.py` has the rest."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from pytest_drive_robust.cli.main import main


def test_a_summary_that_is_too_long_hides_neither_the_links_nor_that_it_was_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []

    def asked(method: str, url: str, token: str, content: Any = None) -> Any:
        said.extend([] if content is None else [content["body"]])
        return [] if method == "GET" else {"id": 1}

    monkeypatch.setattr("pytest_drive_robust.cli.comment._ask", asked)
    event, summary = tmp_path / "event.json", tmp_path / "summary.md"
    event.write_text(json.dumps({"pull_request": {"number": 7}}))
    summary.write_text("<details><summary>settings</summary>\n\n" + "| a row |\n" * 10_000 + "\n</details>\n")
    monkeypatch.setenv("GITHUB_TOKEN", "sesame")
    monkeypatch.setenv("GITHUB_EVENT_PATH", str(event))
    assert main(["comment", str(summary), "--link", "report=https://example.org"]) == 0
    (body,) = said
    assert len(body) < 65_536
    _, end, rest = body.partition("| a row |\n\n</details>\n\n")
    assert end
    assert rest == "The rest is in the summary of the run.\n\n[report](https://example.org)\n"
