"""What changes the key of a stored episode besides the identities of its agent and its world."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.perturbations import GpsNoise, Setting
from pytest_drive_robust.runner.cache_key.canonical_text import digest_of
from pytest_drive_robust.runner.plan import EpisodeRequest
from pytest_drive_robust.testing import fake_route

SETTING = Setting.of(GpsNoise(std_m=5))

REQUEST = EpisodeRequest(Episode("driver", "1", str(SETTING), 0), fake_route("1"), SETTING, "some identity")


@pytest.mark.parametrize(
    "other",
    [
        replace(REQUEST, identity="another"),
        replace(REQUEST, episode=replace(REQUEST.episode, seed=1)),
        replace(REQUEST, episode=replace(REQUEST.episode, agent="other")),
        replace(REQUEST, episode=replace(REQUEST.episode, setting="GPS noise 6 m")),
        replace(REQUEST, route=fake_route("1", length_m=61.0)),
    ],
    ids=["identity", "seed", "agent", "setting", "route"],
)
def test_each_part_of_a_request_changes_its_key(other):
    assert other.key != REQUEST.key


def test_a_key_is_hex_and_the_same_in_every_process():
    program = "import sys; sys.path[:0] = sys.argv[1:]\nfrom test_request_key import REQUEST\nprint(REQUEST.key)"
    command = [sys.executable, "-c", program, str(Path(__file__).parent)]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip() == REQUEST.key
    assert len(bytes.fromhex(REQUEST.key)) == 16


def test_numbers_count_by_their_value():
    one, other = (replace(fake_route("1"), weather=replace(REQUEST.route.weather, wetness=wet)) for wet in (5, 5.0))
    assert replace(REQUEST, route=one).key == replace(REQUEST, route=other).key
    assert digest_of(-0.0) == digest_of(0)
    assert digest_of("5") != digest_of(5)
    assert digest_of(True) != digest_of(1)


def test_the_source_of_a_perturbation_that_is_not_ours_is_in_the_key(module):
    text = (
        "from dataclasses import dataclass\nfrom pytest_drive_robust.perturbations import Perturbation\n"
        "@dataclass\nclass Foggy(Perturbation):\n    metres: float = 5.0\n    phrase = 'fog {metres} m'\n"
    )
    keys = []
    for changed in (text, text + "# a comment\n", text):
        setting = Setting.of(module("foggy_module", changed).Foggy())
        keys.append(replace(REQUEST, setting=setting).key)
    assert keys[0] == keys[2] != keys[1]


def test_files_that_a_perturbation_names_are_in_the_key(module, tmp_path):
    text = (
        "from dataclasses import dataclass\nfrom typing import ClassVar\n"
        "from pytest_drive_robust.perturbations import Perturbation\n"
        "@dataclass\nclass Foggy(Perturbation):\n    metres: float = 5.0\n    phrase = 'fog {metres} m'\n"
        f"    files: ClassVar = ({str(tmp_path / 'table.txt')!r},)\n"
    )
    request = replace(REQUEST, setting=Setting.of(module("foggy_files_module", text).Foggy()))
    with pytest.raises(UsageError, match=r"table\.txt', which cannot be read: No such file"):
        _ = request.key
    keys = []
    for content in ("3", "60", "3"):
        (tmp_path / "table.txt").write_text(content)
        keys.append(replace(request).key)
    assert keys[0] == keys[2] != keys[1]
