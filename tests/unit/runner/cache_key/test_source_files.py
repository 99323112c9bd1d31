from __future__ import annotations

import importlib.util
import sys
import zipfile
from types import ModuleType

import pytest

from pytest_drive_robust.runner.cache_key.code_text import code_of
from pytest_drive_robust.runner.cache_key.source_files import (
    UnknownSourceError,
    code_digest,
    file_of,
    source_digest,
)


def test_code_that_cannot_be_found_has_no_digest(tmp_path):
    moved = ModuleType("moved")
    moved.__file__ = str(tmp_path / "moved.py")
    with pytest.raises(UnknownSourceError, match=r"moved\.py"):
        code_digest([moved])


def test_every_file_of_a_package_counts_in_its_digest(module, tmp_path):
    module("driving_pkg.__init__", "")
    package = sys.modules["driving_pkg"]
    first = code_digest([package])
    (tmp_path / "driving_pkg" / "inner").mkdir()
    (tmp_path / "driving_pkg" / "inner" / "tables.py").write_text("LIMIT = 5\n")
    assert code_digest([package]) != first


def test_a_class_keeps_its_file_when_its_module_goes_or_another_takes_the_name(tmp_path, monkeypatch):
    """As where two conftest.py share a name: pytest forgets the first one when it imports the second."""

    def agent(folder: str) -> type:
        (tmp_path / folder).mkdir()
        file = tmp_path / folder / "sharing.py"
        file.write_text(f"class Agent:\n    def act(self, observation):\n        return {folder!r}\n")
        spec = importlib.util.spec_from_file_location("sharing", file)
        made = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, "sharing", made)
        spec.loader.exec_module(made)
        return made.Agent

    first = agent("one")
    before = code_of(first)
    monkeypatch.delitem(sys.modules, "sharing")
    assert code_of(first) == before
    second = agent("other")
    assert file_of(first) == tmp_path / "one" / "sharing.py"
    assert file_of(second) == tmp_path / "other" / "sharing.py"
    assert code_of(first) == before != code_of(second)


def test_methods_that_were_made_elsewhere_do_not_tell_where_a_class_is(module):
    """Those of a dataclass stand in no file, a decorated one in that of its decorator, an inherited one elsewhere."""
    module("decorating", "def decorated(f):\n    def inner(self):\n        return f(self)\n    return inner\n")
    head = "from dataclasses import dataclass\nfrom decorating import decorated\n\n@dataclass\nclass Agent:\n"
    made = module("made", f"{head}    x: int\n\n    @decorated\n    def act(self):\n        return 0\n")
    assert file_of(made.Agent).name == "made.py"


@pytest.mark.parametrize(
    "line",
    [
        "import math; import tuning",
        "import tuning; SPEED = 1",
        "try: import tuning\nexcept ImportError: pass",
        "if True: import tuning",
        "if True: from tuning import SPEED",
        "\ufeffimport tuning",
        "\x0cimport tuning",
        "import math, \\\n  tuning",
        "import \\\n  tuning",
        "from tuning \\\n  import SPEED",
        "from \\\n  tuning import SPEED",
        "def late(): from .import tuning",
        "def late(): from.tuning import SPEED",
    ],
)
def test_an_import_counts_wherever_it_stands_in_its_line(module, line):
    def code_at(speed: int) -> str:
        module("tuning", f"SPEED = {speed}\n")
        return code_of(module("tuned", f"{line}\nclass Agent: pass\n").Agent)

    assert code_at(6) == code_at(6) != code_at(0)


def test_an_import_counts_whose_name_is_not_ascii(module):
    def code_at(speed: int) -> str:
        module("größen", f"SPEED = {speed}\n")
        return code_of(module("tuned", "from größen import SPEED\nclass Agent: pass\n").Agent)

    assert code_at(6) == code_at(6) != code_at(0)


@pytest.mark.parametrize(
    "files",
    [
        ("near.tuning", "far.tuning"),
        ("near.tuning.__init__", "far.tuning.__init__"),
        ("tuned.near.__init__", "tuned.near.tuning", "tuned.far.__init__", "tuned.far.tuning"),
    ],
    ids=["modules", "packages", "relative"],
)
def test_files_of_one_name_in_several_folders_all_count(module, files):
    relative = files[0].startswith("tuned")
    places = [file for file in files if "tuning" in file]

    def code_at(*speeds: int) -> str:
        for file in files:
            module(file, "def late():\n    from .tuning import SPEED\n" if relative and file not in places else "")
        for place, speed in zip(places, speeds, strict=True):
            module(place, f"SPEED = {speed}\n")
        text = "from near import tuning\nfrom far import tuning as other\nclass Agent: pass\n"
        return code_of(
            module("tuned.__init__" if relative else "tuned", "class Agent: pass\n" if relative else text).Agent
        )

    assert code_at(1, 1) == code_at(1, 1)
    assert len({code_at(1, 1), code_at(2, 1), code_at(1, 2), code_at(2, 2)}) == 4


def test_what_a_package_reaches_through_a_link_counts(module, tmp_path):
    (tmp_path / "shared").mkdir()
    module("driving_pkg.__init__", "")
    (tmp_path / "driving_pkg" / "nets").symlink_to(tmp_path / "shared")

    def code_at(speed: int) -> str:
        (tmp_path / "shared" / "tuning.py").write_text(f"SPEED = {speed}\n")
        text = "from driving_pkg.nets.tuning import SPEED\nclass Agent: pass\n"
        return code_of(module("driving_pkg.agent", text).Agent)

    assert code_at(6) == code_at(6) != code_at(0)


def test_the_first_import_of_a_package_may_lead_through_a_link(module, tmp_path):
    (tmp_path / "shared").mkdir()
    module("driving_pkg.__init__", "")
    (tmp_path / "driving_pkg" / "nets").symlink_to(tmp_path / "shared")

    def code_at(speed: int) -> str:
        (tmp_path / "shared" / "tuning.py").write_text(f"SPEED = {speed}\n")
        return code_of(module("tuned", "import driving_pkg.nets.tuning\nclass Agent: pass\n").Agent)

    assert code_at(6) == code_at(6) != code_at(0)


def test_two_dots_lead_to_the_folder_above(module):
    def code_at(speed: int) -> str:
        module("space.tuning", f"SPEED = {speed}\n")
        text = "class Agent: pass\n"
        module("space.inner.helper", "def late():\n    from ..tuning import SPEED\n")
        return code_of(module("tuned", f"from space.inner import helper\n{text}").Agent)

    assert code_at(6) == code_at(6) != code_at(0)


def test_the_name_of_a_file_in_a_package_counts_in_its_digest(module, tmp_path):
    for name in ("__init__", "one", "two"):
        module(f"driving_pkg.{name}", f"NAME = {name!r}\n")
    first = code_digest(["driving_pkg"])
    (tmp_path / "driving_pkg" / "two.py").rename(tmp_path / "driving_pkg" / "too.py")
    assert code_digest(["driving_pkg"]) != first


def test_code_that_lies_in_a_zip_file_is_known_to_nobody_but_this_session(module, tmp_path, monkeypatch):
    with zipfile.ZipFile(tmp_path / "lib.zip", "w") as file:
        file.writestr("zipped_tuning.py", "SPEED = 5\n")
    monkeypatch.syspath_prepend(tmp_path / "lib.zip")
    agent = module("tuned", "from zipped_tuning import SPEED\nclass Agent: pass\n").Agent
    assert code_of(agent).startswith("session ")
    assert source_digest(agent) == ""


def test_a_link_by_which_an_editor_locks_a_file_is_no_code(module, tmp_path):
    module("driving_pkg.__init__", "")
    first = code_digest(["driving_pkg"])
    (tmp_path / "driving_pkg" / ".#__init__.py").symlink_to("somebody@somewhere.1234:5678")
    assert code_digest(["driving_pkg"]) == first


def test_a_module_counts_that_has_the_name_of_one_of_the_standard_library(module):
    assert "this" in sys.stdlib_module_names

    def code_at(speed: int) -> str:
        module("this", f"SPEED = {speed}\n")
        return code_of(module("tuned", "from this import SPEED\nclass Agent: pass\n").Agent)

    assert code_at(6) == code_at(6) != code_at(0)
