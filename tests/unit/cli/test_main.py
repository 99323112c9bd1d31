"""What `drive-robust` does for every command, in the process and once from outside."""

from __future__ import annotations

import io
import subprocess
import sys
from pathlib import Path

import pytest

from pytest_drive_robust.cli.main import COMMANDS, main
from pytest_drive_robust.registry import registry
from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.testing import fake_route

FAKE = "pytest_drive_robust.testing:FakeSimulator"


@pytest.mark.parametrize(
    ("plugin", "told"),
    [
        ("conftes.py", "-p is 'conftes.py', but there is no such file"),
        ("no_such_plugin", "expected a module that can be imported or the path of a conftest.py"),
        ("cli_agents", "registers no names: it has no function pytest_drive_robust_register"),
        ("leaves.py", "SystemExit: not here"),
    ],
)
def test_a_plugin_that_cannot_be_used_exits_with_4_and_one_message(
    plugin: str, told: str, agents_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (agents_folder / "leaves.py").write_text("raise SystemExit('not here')")
    assert main(["-p", plugin, "list"]) == 4
    captured = capsys.readouterr()
    assert told in captured.err
    assert captured.err.startswith("drive-robust: ")
    assert "Traceback" not in captured.err


@pytest.mark.parametrize(
    "words",
    [
        ["compare", "a", "b", "--json", ""],
        ["compare", "a", "--fail-on=", "b"],
        ["store", "gc", "--older-than", "30d", "--store", " "],
        ["doctor", "--python="],
        ["bless", "a", "--reason", ""],
    ],
    ids=" ".join,
)
def test_an_option_with_a_blank_value_is_refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    flag = next(word.rstrip("=") for word in reversed(words) if word.startswith("--"))
    assert main(words) == 4
    assert f"drive-robust: {flag} is empty, expected " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("hook", "told"),
    [
        ("(reg): pass", "but its pytest_drive_robust_register(reg) raised TypeError: "),
        ("(registry): 1 / 0", "raised ZeroDivisionError: division by zero ("),
        ("(registry): raise SystemExit('no licence')", "raised SystemExit: no licence ("),
        ("(registry): registry.register_metric('DS', len)", "'DS' is a built-in metric"),
        (" = 3", "raised TypeError: "),
    ],
)
def test_a_hook_that_breaks_exits_with_4_and_names_its_file(
    hook: str, told: str, agents_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delitem(sys.modules, "conftest", raising=False)
    name = "pytest_drive_robust_register"
    (agents_folder / "conftest.py").write_text(f"{name}{hook}" if "=" in hook else f"\ndef {name}{hook}")
    assert main(["-p", "conftest.py", "list", "agents"]) == 4
    message = capsys.readouterr().err
    assert message.startswith("drive-robust: ")
    assert told in message
    if "built-in" not in told:
        assert "-p is 'conftest.py'" in message
        assert str(agents_folder / "conftest.py") in message
        assert "Expected pytest_drive_robust_register(registry)" in message
    if "(" in told[-1]:
        assert "conftest.py:2)" in message


@pytest.mark.parametrize("inside", ["", "pack"])
def test_a_module_or_a_conftest_registers_names(
    inside: str, agents_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A `conftest.py` may import its neighbours, by the name of its package where it is in one."""
    registry.forget_names()
    source = (agents_folder / "cli_agents.py").read_text()
    neighbour = "pack.drivers" if inside else "drivers"
    hook = "def pytest_drive_robust_register(registry): registry.register_agent({!r}, Good)\n"
    (agents_folder / "suites" / inside).mkdir(parents=True)
    if inside:
        (agents_folder / "suites" / inside / "__init__.py").touch()
    (agents_folder / "suites" / inside / "drivers.py").write_text(source)
    (agents_folder / "suites" / inside / "conftest.py").write_text(
        f"from {neighbour} import Good\n" + hook.format("mine")
    )
    (agents_folder / "of_a_module.py").write_text("from cli_agents import Good\n" + hook.format("another"))
    for module in ("conftest", "pack", "pack.conftest", "drivers", "pack.drivers", "of_a_module", "cli_agents"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    plugins = ("-p", (Path("suites") / inside / "conftest.py").as_posix(), "-p", "of_a_module")
    assert main([*plugins, "check-agent", "mine", "--sim", FAKE]) == 0
    assert main(["check-agent", "another", "--sim", FAKE]) == 0
    assert main([*plugins, "list", "agents"]) == 0  # the same once more is no second registration
    registry.forget_names()
    capsys.readouterr()
    assert main(["check-agent", "mine", "--sim", FAKE]) == 4
    assert "drive-robust COMMAND reads it with -p conftest.py" in capsys.readouterr().err


def test_the_version_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main(["--version"])
    assert left.value.code == 0
    assert capsys.readouterr().out.startswith("drive-robust ")


def test_the_module_runs_as_a_program() -> None:
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-m", "pytest_drive_robust.cli", "list", "simulators"],
        capture_output=True,
        text=True,
        check=False,
        cwd=root,
    )
    assert done.returncode == 0, done.stderr
    assert "embedded" in done.stdout


def test_every_command_of_the_table_has_a_module_and_is_listed_by_help(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--help"])
    shown = capsys.readouterr().out
    for name in COMMANDS:
        assert name in shown.split()
        with pytest.raises(SystemExit) as left:
            main([name, "--help"])
        assert left.value.code == 0
        after_usage = capsys.readouterr().out.partition("\n\n")[2]
        assert after_usage[0].isupper(), f"{name} does not say what it does"


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["export", "nosuch", "--format", "csv", "folder"], "there is no stored run named 'nosuch'"),
        (["routes", "draw", "dev10", "--size", "9", "301"], "--size is 9, expected 64 to 2048"),
    ],
)
@pytest.mark.usefixtures("home")
def test_words_that_may_be_left_out_stand_behind_options_too(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 4
    assert told in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["chek-agent", "blind"], "Did you mean 'check-agent'?"),
        (["routes", "lst"], "Did you mean 'list'?"),
        (["routes", "list", "--smi", "embedded"], "routes list: error: unrecognized arguments: --smi."),
        (["replay", "601", "--agnt=blind"], "Did you mean '--agent'?"),
        (["replay", "601", "602"], "replay: error: unrecognized arguments: 602.\n"),
    ],
)
def test_a_word_that_does_not_parse_is_answered_with_the_nearest_one(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        main(arguments)
    assert left.value.code == 2
    assert told in capsys.readouterr().err


def test_only_the_module_of_the_command_is_imported() -> None:
    program = (
        "import sys\n"
        "from pytest_drive_robust.cli.main import main\n"
        "main(['runs', 'list'])\n"
        "print(*sorted(name for name in sys.modules if name.startswith('pytest_drive_robust.cli.')))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1].split() == [
        f"pytest_drive_robust.cli.{name}" for name in ("main", "runs", "tables")
    ]


def test_ctrl_c_ends_a_command_with_a_word_and_the_exit_code_of_a_shell(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*arguments: object, **options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("pytest_drive_robust.cli.list.print_table", interrupted)
    assert main(["list", "agents"]) == 130
    assert capsys.readouterr().err == "drive-robust: interrupted\n"


@pytest.mark.parametrize("words", [["doctor"], ["list", "agents"]], ids=["lines", "table"])
def test_a_reader_that_stops_reading_gets_no_traceback(words: list[str]) -> None:
    command = [sys.executable, "-m", "pytest_drive_robust.cli", *words]
    printing = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert printing.stdout is not None
    printing.stdout.close()
    assert printing.communicate()[1] == ""
    assert printing.returncode == 1


@pytest.mark.parametrize(
    ("words", "code", "shown"),
    [
        (["routes", "list", "räume.xml"], 0, "r\\xe4ume.xml: 1 route"),
        (["check-agent", "cli_agents:Good", "--sim", FAKE, "--routes", "räume.xml"], 0, "on \\xfc Straight:"),
        (["doctor", "--root", "räume"], 1, "r\\xe4ume"),
    ],
    ids=["table", "lines", "verdict"],
)
def test_what_a_terminal_has_no_characters_for_is_spelled_out(
    words: list[str], code: int, shown: str, agents_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_routes([fake_route("ü")], agents_folder / "räume.xml")
    screen = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", screen)
    assert main(words) == code
    assert shown in screen.buffer.getvalue().decode("ascii")  # type: ignore[attr-defined]
