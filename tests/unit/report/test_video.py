"""Videos and pictures as files: playable, or not there at all."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.report.video import has_encoder, write_png, write_video

Pixels = NDArray[np.uint8]


def pictures(count: int = 30) -> Iterator[Pixels]:
    for k in range(count):
        picture = np.zeros((120, 160, 3), np.uint8)
        picture[:, :, 0] = 200
        picture[20:60, 2 * k : 2 * k + 20] = (20, 200, 40)
        yield picture


@pytest.fixture
def no_encoder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "av", None)


def test_a_video_decodes_to_what_was_written(tmp_path: Path) -> None:
    av = pytest.importorskip("av")
    path = tmp_path / "film.mp4"
    seen = []
    write_video(path, pictures(), rate_hz=20, wrote=lambda: seen.append(1))
    assert len(seen) == 30
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert stream.average_rate == 20
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]
    assert len(frames) == 30
    for written, read in zip(pictures(), frames, strict=True):
        assert np.abs(written.astype(int) - read).mean() < 12.0
    assert (frames[0] != frames[-1]).any()


def test_a_video_starts_before_it_is_loaded(tmp_path: Path) -> None:
    pytest.importorskip("av")
    write_video(tmp_path / "film.mp4", pictures(), rate_hz=20)
    data = (tmp_path / "film.mp4").read_bytes()
    assert 0 < data.index(b"moov") < data.index(b"mdat")


def test_a_video_that_breaks_leaves_nothing_and_keeps_the_old_one(tmp_path: Path) -> None:
    pytest.importorskip("av")

    def breaking() -> Iterator[Pixels]:
        yield from pictures(3)
        raise RuntimeError("out of pictures")

    path = tmp_path / "film.mp4"
    path.write_bytes(b"old")
    with pytest.raises(RuntimeError, match="out of pictures"):
        write_video(path, breaking(), rate_hz=20)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_video_of_nothing_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("av")
    with pytest.raises(UsageError, match="no picture"):
        write_video(tmp_path / "film.mp4", (), rate_hz=20)
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("no_encoder")
def test_without_an_encoder_the_error_names_the_extra(tmp_path: Path) -> None:
    assert not has_encoder()
    with pytest.raises(UsageError, match=r"pip install 'pytest-drive-robust\[video\]'"):
        write_video(tmp_path / "film.mp4", pictures(), rate_hz=20)
    assert not list(tmp_path.iterdir())


def test_a_png_holds_the_picture_exactly(tmp_path: Path) -> None:
    import cv2

    picture = next(pictures())
    write_png(tmp_path / "strip.png", picture)
    read = cv2.imread(str(tmp_path / "strip.png"))
    assert read is not None
    assert (read[:, :, ::-1] == picture).all()
    assert [path.name for path in tmp_path.iterdir()] == ["strip.png"]


def test_a_folder_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot write"):
        write_png(tmp_path / "none" / "strip.png", next(pictures()))
