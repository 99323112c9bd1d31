"""Names of exported files."""

from __future__ import annotations

import pytest

from pytest_drive_robust.results.scene import Scene


def name_of(title: str) -> str:
    return Scene(title, {}, {}).file_name


def test_a_plain_title_is_read_in_the_name() -> None:
    assert name_of("3901 GreenLight GPS noise 15 m blind seed 0") == "3901-GreenLight-GPS-noise-15-m-blind-seed-0"


@pytest.mark.parametrize("one", ["a/b S clean x seed 0", "a-b S clean x seed 0", "a:b S clean x seed 0"])
def test_two_titles_never_share_a_file(one: str) -> None:
    other = "a b S clean x seed 0"
    assert name_of(one) != name_of(other)
    assert name_of(one).startswith(name_of(other))


@pytest.mark.parametrize("letter", ["x", "路"])
def test_a_name_fits_on_a_disk_however_long_the_title_is(letter: str) -> None:
    names = {name_of(letter * 400 + end) for end in ("a", "b")}
    assert len(names) == 2
    assert all(len(name.encode()) <= 200 for name in names)
