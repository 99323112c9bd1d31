"""Writes H.264 videos in MP4 with PyAV, an optional extra, and PNG pictures; a file is whole or not there."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.jit.arrays import Pixels
from pytest_drive_robust.store.whole_file import refusing_unwritable, whole_file, write_whole

EXTRA = "pytest-drive-robust[video]"
"""The package with the extra to install for videos."""

_ENCODER = "libx264"
"""The encoder; the wheels of PyAV include it, other builds of FFmpeg may lack it."""


def has_encoder() -> bool:
    """Return True when a video can be written here."""
    try:
        import av
    except ImportError:
        return False
    return _ENCODER in av.codecs_available


def write_video(
    path: Path, pictures: Iterable[Pixels], *, rate_hz: int, wrote: Callable[[], object] | None = None
) -> None:
    """Write pictures, all (height, width, 3) uint8 RGB with even sides, as a video that browsers play.

    The video is 8-bit 4:2:0 in BT.709 with the index in front, so that playing starts before all is loaded. `wrote()`
    is called after every picture; pictures are taken one at a time. Raises `UsageError` when no encoder is installed,
    `path` cannot be written, or there is no picture; then `path` is unchanged.
    """
    if not has_encoder():
        raise UsageError(f"no H.264 encoder is installed: pip install '{EXTRA}'.")
    import av
    from av.video.reformatter import Colorspace, VideoReformatter

    bt709 = int(Colorspace.ITU709)

    with (
        refusing_unwritable(path),
        whole_file(path) as temporary,
        av.open(str(temporary), "w", format="mp4", options={"movflags": "+faststart"}) as container,
    ):
        stream: Any = None
        reformatter = VideoReformatter()  # reused, because creating one takes longer than using it
        for picture in pictures:
            if stream is None:
                stream = _stream(container, picture, rate_hz)
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            frame = reformatter.reformat(frame, format="yuv420p", src_colorspace=bt709, dst_colorspace=bt709)
            container.mux(stream.encode(frame))
            if wrote is not None:
                wrote()
        if stream is None:
            raise UsageError(f"there is no picture to write to {str(path)!r}.")
        container.mux(stream.encode())


def write_png(path: Path, picture: Pixels) -> None:
    """Write one RGB picture. Raises `UsageError` when the path cannot be written."""
    import cv2

    data = cv2.imencode(".png", picture[:, :, ::-1])[1].tobytes()
    with refusing_unwritable(path):
        write_whole(path, data)


def _stream(container: Any, picture: Pixels, rate_hz: int) -> Any:
    options = {"crf": "20", "preset": "veryfast"}
    stream = container.add_stream(_ENCODER, rate=Fraction(rate_hz), options=options)
    stream.height, stream.width = picture.shape[:2]
    stream.pix_fmt = "yuv420p"
    context = stream.codec_context
    context.gop_size = rate_hz * 2  # a key frame every 2 s, to which players can jump
    context.colorspace = context.color_primaries = context.color_trc = 1  # BT.709
    context.color_range = 1  # 16..235
    return stream
