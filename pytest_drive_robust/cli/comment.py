"""`drive-robust comment`: put the summary of a run on a pull request, in one comment that later runs change."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Mapping
from http.client import HTTPException
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

from pytest_drive_robust.cli.tables import say
from pytest_drive_robust.errors import UsageError

_DESCRIPTION = """Puts FILE, what pytest wrote to GITHUB_STEP_SUMMARY, on the pull request of a GitHub workflow. Another
run changes the same comment. Without a token, or where GitHub refuses it, nothing is written and the exit code is 0:
the verdict is pytest's."""
_MOST = 65_536 - 1024
"""Longest summary in characters: the longest comment that GitHub takes, less the lines that we add."""
_PAGE, _PATIENCE_S = 100, 30.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `comment`."""
    parser.description = _DESCRIPTION
    parser.add_argument("file", metavar="FILE", help="the Markdown to put there")
    parser.add_argument(
        "--name",
        default="drive-robust",
        help="change the comment of this name only, where one pull request has several; default: drive-robust",
    )
    parser.add_argument(
        "--link",
        action="append",
        default=[],
        metavar="NAME=URL",
        help="put this link below the summary; repeatable; left out when URL is empty",
    )
    parser.set_defaults(command=_comment)


def _comment(options: argparse.Namespace) -> int:
    try:
        text = Path(options.file).read_text(encoding="utf-8").strip()
    except (OSError, ValueError) as error:
        problem = getattr(error, "strerror", None) or error
        raise UsageError(f"FILE is {options.file!r}, which cannot be read: {problem}.") from None
    links = [link.partition("=") for link in options.link]
    for name, equals, _ in links:
        if not equals:
            raise UsageError(f"--link is {name!r}, expected NAME=URL as in report=https://example.org/report.")
    environ = os.environ
    token, pull = environ.get("GITHUB_TOKEN", ""), _pull_request(environ)
    if not pull or not token:
        say(f"no comment: {'there is no GITHUB_TOKEN' if pull else 'this is not a pull request'}")
        return 0
    mark = f"<!-- pytest-drive-robust: {options.name} -->"
    commit = str(pull.get("head", {}).get("sha", ""))[:7]
    words = [f"[{name}]({url})" for name, _, url in links if url] + ([commit] if commit else [])
    body = f"{mark}\n{_cut(text or 'The run ended before there was anything to tell.')}\n\n{' · '.join(words)}\n"
    api = f"{environ.get('GITHUB_API_URL', 'https://api.github.com')}/repos/{environ.get('GITHUB_REPOSITORY', '')}"
    try:
        say(_put(api, token, int(pull["number"]), mark, body))
    except HTTPError as error:
        hint = (
            ". The job needs `permissions: pull-requests: write`; forks have none" if error.code in (401, 403) else ""
        )
        print(f"no comment: GitHub answered {error.code} {error.reason}{hint}", file=sys.stderr)
    except (OSError, HTTPException, ValueError) as error:
        print(f"no comment: GitHub was not reached: {error}", file=sys.stderr)
    return 0


def _pull_request(environ: Mapping[str, str]) -> dict[str, Any]:
    """Return the pull request of GitHub's event file, empty where the event is no pull request."""
    try:
        pull = json.loads(Path(environ["GITHUB_EVENT_PATH"]).read_text(encoding="utf-8")).get("pull_request")
    except (KeyError, OSError, ValueError, AttributeError):
        return {}
    return pull if isinstance(pull, dict) and "number" in pull else {}


def _put(api: str, token: str, number: int, mark: str, body: str) -> str:
    """Change the comment that begins with `mark`, or add a comment; return a sentence about the change."""
    page = 1
    while True:
        found = _ask("GET", f"{api}/issues/{number}/comments?per_page={_PAGE}&page={page}", token)
        ours = next((item for item in found if str(item.get("body", "")).startswith(mark)), None)
        if ours is not None:
            _ask("PATCH", f"{api}/issues/comments/{int(ours['id'])}", token, {"body": body})
            return f"comment {ours['id']} updated"
        if len(found) < _PAGE:
            return f"comment {_ask('POST', f'{api}/issues/{number}/comments', token, {'body': body})['id']} added"
        page += 1


def _ask(method: str, url: str, token: str, content: Mapping[str, str] | None = None) -> Any:
    data = None if content is None else json.dumps(content).encode()
    headers = {"Authorization": f"Bearer {token}", "Accept": "application/vnd.github+json"}
    headers |= {"Content-Type": "application/json", "User-Agent": "pytest-drive-robust"}
    with urlopen(Request(url, data, headers, method=method), timeout=_PATIENCE_S) as answer:
        return json.load(answer)


def _cut(text: str) -> str:
    if len(text) <= _MOST:
        return text
    kept = text[:_MOST].rpartition("\n")[0]
    if kept.count("<details>") > kept.count("</details>"):  # an open element would fold away the lines below, too
        kept += "\n\n</details>"
    return f"{kept}\n\nThe rest is in the summary of the run."
