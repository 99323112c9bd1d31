"""The shell parts of `action.yml`, run here: what a push and a pull request lead to, with a made-up GitHub."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import parse_qs, urlsplit

import pytest

yaml = pytest.importorskip("yaml", reason="PyYAML is not installed: pip install -e '.[dev]'")

ACTION = Path(__file__).parents[2] / "action.yml"
PIP = """#!/bin/sh
if [ "$1 $2" = "-m pip" ]; then printf '%s\\n' "$@" > "$RUNNER_TEMP/pip"; exit; fi
exec {python} "$@"
"""
AGENT = """

def slow():
    return ScriptedAgent([Control(throttle=0.1)])


AGENTS.append(slow)
"""


class GitHub(ThreadingHTTPServer):
    """Keeps the comments of pull request 7; answers `refuses` instead where that is not 0."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.comments = [{"id": number, "body": "looks good"} for number in range(150)]
        self.asked: list[str] = []
        self.refuses = 0

    @property
    def ours(self) -> list[str]:
        return [item["body"] for item in self.comments if "pytest-drive-robust" in item["body"]]


class Handler(BaseHTTPRequestHandler):
    server: GitHub

    def log_message(self, *_: object) -> None:
        pass

    def answer(self) -> None:
        self.server.asked.append(self.command)
        length = int(self.headers.get("Content-Length") or 0)
        content = json.loads(self.rfile.read(length)) if length else {}
        code, found = self.server.refuses or 200, None
        if self.headers["Authorization"] != "Bearer sesame":
            code = 401
        place = urlsplit(self.path)
        number = place.path.rpartition("/")[2]
        if code != 200:
            found = {"message": "no"}
        elif place.path == "/repos/me/cars/issues/7/comments" and self.command == "GET":
            query = {name: int(values[0]) for name, values in parse_qs(place.query).items()}
            first = (query["page"] - 1) * query["per_page"]
            found = self.server.comments[first : first + query["per_page"]]
        elif place.path == "/repos/me/cars/issues/7/comments" and self.command == "POST":
            found = {"id": len(self.server.comments), **content}
            self.server.comments.append(found)
        elif place.path == f"/repos/me/cars/issues/comments/{number}" and self.command == "PATCH":
            found = self.server.comments[int(number)]
            found.update(content)
        data = json.dumps(found).encode()
        self.send_response(code if found is not None else 404)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)

    do_GET = do_POST = do_PATCH = answer  # noqa: N815


@pytest.fixture
def github():
    with GitHub() as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.05,))
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def filled(text: str, known: dict[str, str]) -> str:
    return re.sub(r"\$\{\{ (.*?) \}\}", lambda found: known[found[1]], text)


class Cached(NamedTuple):
    """A cache of GitHub: a job sees those of its own branch, and a pull request those of the base branch, too."""

    branch: str
    key: str
    path: str
    kept: Path


class Job:
    """Runs the steps of the action that are shell, in order, as GitHub does it; and its caches, but for kernels."""

    def __init__(self, folder: Path, github: GitHub) -> None:
        self.folder, self.github = folder, github
        self.caches: list[Cached] = []
        self.temp = folder / "temp"
        (self.temp / "bin").mkdir(parents=True)
        (self.temp / "bin" / "python").write_text(PIP.format(python=sys.executable))
        (self.temp / "bin" / "python").chmod(0o755)

    def run(self, inputs: dict[str, str], **environment: str) -> tuple[dict[str, int], str]:
        """Return the exit code of each step that ran, and the step summary."""
        action = yaml.safe_load(ACTION.read_text(encoding="utf-8"))
        known = {f"inputs.{name}": str(given.get("default", "")) for name, given in action["inputs"].items()}
        known |= {f"inputs.{name}": value for name, value in inputs.items()}
        known |= {"runner.os": "Linux", "runner.arch": "X64", "github.run_id": "42", "github.run_attempt": "1"}
        known |= {"github.action_path": "/action", "steps.upload.outputs.artifact-url": "https://files.invalid/1"}
        files = {name: self.temp / name for name in ("output", "summary")}
        for file in files.values():
            file.write_text("")
        codes: dict[str, int] = {}
        for step in action["runs"]["steps"]:
            if "actions/cache/" in step.get("uses", ""):
                self.cache(step, known, environment)
            if "run" not in step or (step["name"] == "Comment" and known["inputs.comment"] != "true"):
                continue
            told = self.shell(step, known, environment, files)
            codes[step["name"]] = told.returncode
            self.said = told.stdout + told.stderr
            if told.returncode and step["name"] != "Verdict":
                raise AssertionError(f"{step['name']}: {self.said}")
            for line in files["output"].read_text().splitlines():
                known[f"steps.{step.get('id')}.outputs.{line.partition('=')[0]}"] = line.partition("=")[2]
            files["output"].write_text("")
            if step["name"] == "Comment":
                self.commented = self.said
            if step["name"] == "Drive":
                self.drove = self.said
        return codes, files["summary"].read_text()

    def cache(self, step: dict[str, Any], known: dict[str, str], environment: dict[str, str]) -> None:
        """Keep or restore what lies in the checkout. Of several caches the newest one of the own branch comes first."""
        told = {name: filled(text, known) for name, text in step["with"].items()}
        branch, base = environment["GITHUB_REF_NAME"], environment.get("GITHUB_BASE_REF", "")
        (path,) = (line for line in told["path"].split() if not line.startswith("~"))
        if "cache/restore" in step["uses"]:
            seen = [item for name in (base, branch) for item in self.caches if item.branch == name]
            found = [item for item in seen if item.key.startswith(told["restore-keys"]) and item.path == told["path"]]
            if found:
                shutil.copytree(found[-1].kept, self.folder / path, dirs_exist_ok=True)
        elif (self.folder / path).is_dir() and not (base and "github.base_ref == ''" in step["if"]):
            kept = self.temp / f"cache{len(self.caches)}"
            shutil.copytree(self.folder / path, kept)
            self.caches.append(Cached(branch, told["key"], told["path"], kept))

    def shell(
        self, step: dict[str, Any], known: dict[str, str], environment: dict[str, str], files: dict[str, Path]
    ) -> subprocess.CompletedProcess[str]:
        dropped = ("PYTEST_", "COV_", "GITHUB_")
        kept = {name: text for name, text in os.environ.items() if not name.startswith(dropped)}
        path = (str(self.temp / "bin"), str(Path(sys.executable).parent), os.environ["PATH"])
        kept |= {
            "PATH": os.pathsep.join(path),
            "HOME": str(self.temp),
            "RUNNER_TEMP": str(self.temp),
            "GITHUB_OUTPUT": str(files["output"]),
            "GITHUB_STEP_SUMMARY": str(files["summary"]),
            "GITHUB_API_URL": f"http://127.0.0.1:{self.github.server_port}",
            "GITHUB_SERVER_URL": "https://github.invalid",
            "GITHUB_REPOSITORY": "me/cars",
            "GITHUB_RUN_ID": "42",
            "no_proxy": "127.0.0.1",
            **environment,
            **{name: filled(str(text), known) for name, text in step.get("env", {}).items()},
        }
        folder = self.folder / filled(step.get("working-directory", "."), known)
        assert "${{" not in step["run"], "what people may write must come by the environment"
        command = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]]
        return subprocess.run(command, cwd=folder, env=kept, capture_output=True, text=True, check=False)


@pytest.fixture
def job(suite, github) -> Job:
    folder = suite("DS under clean >= 90", "DS under throttle 0.9 >= 90", conftest=AGENT).path
    return Job(folder, github)


MAIN = {"GITHUB_REF_NAME": "main"}
INPUTS = {"pytest": '--drive-agent steady -k "test_requirement"', "token": "sesame", "install": "-e '.[my agent]'"}


def pull_request(job: Job) -> dict[str, str]:
    event = job.temp / "event.json"
    event.write_text(json.dumps({"pull_request": {"number": 7, "head": {"sha": "0123456789abcdef"}}}))
    return {"GITHUB_REF_NAME": "7/merge", "GITHUB_BASE_REF": "main", "GITHUB_EVENT_PATH": str(event)}


@pytest.mark.slow
def test_a_push_keeps_a_run_and_a_pull_request_is_compared_with_it_in_one_comment(job, github):
    codes, summary = job.run(INPUTS, **MAIN)
    assert codes == {"Install": 0, "Drive": 0, "Comment": 0, "Verdict": 0}
    assert (job.temp / "pip").read_text().splitlines()[4:] == [
        *("/action", "/action/agents", "pytest-github-actions-annotate-failures", "-e", ".[my agent]")
    ]
    assert "2 of 2 requirements hold" in summary
    assert github.asked == []
    assert (job.folder / "drive-report" / "index.html").is_file()

    codes, summary = job.run({**INPUTS, "pytest": "--drive-agent slow"}, **pull_request(job))
    assert codes["Verdict"] == 1
    (body,) = github.ours
    assert body.startswith("<!-- pytest-drive-robust: drive-robust -->\n## drive-robust: 0 of 2 requirements hold")
    assert summary.strip() in body
    assert "### REGRESSION: 2 of 2 settings against branch-main" in body
    row = re.search(r"\| slow \| clean \| 100.00 \| (\d+\.\d\d) \| 1.00 \| 0.00 \|", body)
    assert row is not None, body
    assert float(row[1]) < 90.0
    assert "newly going wrong:" in body
    assert "[report](https://files.invalid/1)" in body
    assert "[run](https://github.invalid/me/cars/actions/runs/42)" in body
    assert "0123456" in body

    codes, _ = job.run(INPUTS, **pull_request(job))
    assert codes["Verdict"] == 0
    (body,) = github.ours  # the same comment, behind 150 others
    assert "not one score changed" in body
    assert len(github.comments) == 151
    assert github.asked == ["GET", "GET", "POST", "GET", "GET", "PATCH"]


@pytest.mark.slow
def test_without_a_token_or_where_it_is_refused_there_is_the_summary_only(job, github):
    codes, summary = job.run({**INPUTS, "token": ""}, **pull_request(job))
    assert codes["Verdict"] == 0
    assert "no comment: there is no GITHUB_TOKEN" in job.commented
    assert "2 of 2 requirements hold" in summary
    assert github.asked == []
    github.refuses = 403
    codes, _ = job.run(INPUTS, **pull_request(job))
    assert codes["Verdict"] == 0
    assert "GitHub answered 403" in job.commented
    assert "pull-requests: write" in job.commented


@pytest.mark.slow
def test_what_pytest_refuses_ends_the_job_with_its_exit_code(job, github):
    codes, summary = job.run({**INPUTS, "compare": "nowhere"}, **pull_request(job))
    assert codes["Verdict"] == 4
    assert summary == ""
    assert "The run ended before there was anything to tell." in github.ours[0]
    assert job.run({**INPUTS, "compare": "off", "comment": "false"}, **MAIN)[0] == {
        "Install": 0,
        "Drive": 0,
        "Verdict": 0,
    }


@pytest.mark.slow
def test_each_push_of_a_pull_request_is_compared_with_the_newest_run_of_its_base(job):
    job.run(INPUTS, **MAIN)
    assert job.run(INPUTS, **pull_request(job))[0]["Verdict"] == 0
    shutil.rmtree(job.folder / ".drive-robust")  # every job begins with a fresh checkout
    assert job.run({**INPUTS, "pytest": "--drive-agent slow"}, **MAIN)[0]["Verdict"] == 1
    shutil.rmtree(job.folder / ".drive-robust")
    _, summary = job.run(INPUTS, **pull_request(job))
    assert re.search(r"newly without a fault|no regression shown in 2 settings against branch-main", summary), summary
    assert {item.branch for item in job.caches if "-base-" in item.key} == {"main"}


@pytest.mark.slow
def test_a_folder_below_the_root_of_pytest_and_any_name_of_a_branch_are_compared_too(job):
    below = job.folder / "driving"
    below.mkdir()
    for name in ("conftest.py", "test_suite.py", "routes.xml"):
        (job.folder / name).rename(below / name)
    inputs = {**INPUTS, "folder": "driving"}
    branch = {"GITHUB_REF_NAME": "plan/a.json"}
    change = {**pull_request(job), "GITHUB_BASE_REF": "plan/a.json"}
    assert job.run(inputs, **change)[0]["Verdict"] == 0
    assert "no run of the base branch is cached, so nothing is compared with it" in job.drove
    assert job.run(inputs, **branch)[0]["Verdict"] == 0
    assert (below / ".drive-robust" / "runs" / "branch-plan+a-json.json").is_file()
    _, summary = job.run(inputs, **change)
    assert "against branch-plan+a-json" in summary
