"""Motion smear: each image is the mean of the last few."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

from pytest_drive_robust.domain.observation import Image, Observation
from pytest_drive_robust.perturbations.base import Perturbation
from pytest_drive_robust.perturbations.context import NO_CAMERA, EpisodeContext, Spans, cameras_by_name
from pytest_drive_robust.perturbations.severity import checked_choice, checked_count

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pytest_drive_robust.domain.observation import Pixels


@dataclass
class FrameBlend(Perturbation):
    """An image pipeline that smears: long exposure, temporal denoising, a decoder that blends frames.

    Formula: `I~_t = sum(w_i I_i) / sum(w_i)` over the last `frames` images of the camera, rounded to the nearest;
    `"uniform"` weights are 1, `"linear"` weights grow from 1 for the oldest image to `frames` for the newest. At the
    start of an episode the mean goes over the images so far. The tick of capture is that of the newest image.

    Severity: `frames`, a count, 1 (nothing happens) or more. Source: the released code's `BLEND_*` variables; the
    paper does not drive it.

    >>> str(FrameBlend(frames=3, weights="linear"))
    '3 frame blend (weights=linear)'
    """

    frames: int = 3
    weights: Literal["uniform", "linear"] = "uniform"

    phrase: ClassVar[str] = "{frames} frame blend"
    ladder: ClassVar = ("frames", (2.0, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0, 20.0))

    def __post_init__(self) -> None:
        self.frames = checked_count(self, "frames", expected="a whole number of frames of at least 1", low=1)
        checked_choice(self, "weights", ("uniform", "linear"))

    def reset(self, context: EpisodeContext) -> None:
        """Forget all images."""
        self._means: dict[str, _RunningMean] = {}
        self._last: dict[str, Image] = {}
        self._spans = Spans(context.stream)

    def observe(self, observation: Observation) -> Observation:
        """Replace all images by their means, which are new arrays."""
        if self.frames == 1:
            return observation
        self._spans.touch(observation.tick, observation.cameras)
        return observation.map_images(self._blended)

    def idle_reason(self, cameras: tuple[str, ...], dt_s: float) -> str:
        """Return that there is no camera, or that the images were all the same."""
        if not cameras:
            return NO_CAMERA
        return f"the mean of {self.frames} frames is the newest one in {cameras_by_name(cameras)}"

    def _blended(self, camera: str, image: Image) -> Image:
        """Return the mean up to this image; return the last mean again when the camera has taken no new image."""
        last = self._last.get(camera)
        if last is not None and last.tick == image.tick:
            return last
        mean = self._means.get(camera)
        if mean is None:
            mean = self._means[camera] = _RunningMean(self.frames, image.pixels, linear=self.weights == "linear")
        blended = self._last[camera] = Image(mean.push(image.pixels), image.tick).read_only()
        return blended


class _RunningMean:
    """The weighted mean of the last images in whole numbers: exact, and as cheap for 20 images as for 2.

    `plain` is the sum of the images, `ramp` the sum with weights 1, 2, ... from the oldest. A new image changes the
    sums by `ramp += n * new - plain` (all weights fall by one) and `plain += new - oldest`. Unsigned numbers may wrap
    on the way; the final sums always fit. The buffers are kept, because fresh memory costs more than the sums.
    """

    __slots__ = ("_buffer", "_images", "_linear", "_next", "_plain", "_pushed", "_ramp")

    def __init__(self, frames: int, like: Pixels, *, linear: bool) -> None:
        import numpy as np

        weight = frames * (frames + 1) // 2 if linear else frames
        kind = np.dtype(np.uint16 if weight <= 256 else np.uint64)  # 255 * 256 + 128 fits into 16 bits
        self._linear = linear
        self._pushed = 0
        self._images: NDArray[np.unsignedinteger] = np.zeros((frames, *like.shape), dtype=kind)
        self._plain: NDArray[np.unsignedinteger] = np.zeros(like.shape, dtype=kind)
        self._ramp: NDArray[np.unsignedinteger] = np.zeros(like.shape, dtype=kind)
        self._buffer: NDArray[np.unsignedinteger] = np.zeros(like.shape, dtype=kind)

    def push(self, pixels: Pixels) -> Pixels:
        """Add an image and return the mean, both (height, width, 3) uint8."""
        import numpy as np

        frames = len(self._images)
        slot = self._images[self._pushed % frames]  # holds the oldest image, or zeros as long as there is room
        full = self._pushed >= frames
        self._pushed += 1
        count = min(self._pushed, frames)
        if self._linear and full:
            self._ramp -= self._plain
        self._plain -= slot
        slot[...] = pixels
        self._plain += slot
        if self._linear:
            self._ramp += np.multiply(slot, count, out=self._buffer)
        total, weight = (self._ramp, count * (count + 1) // 2) if self._linear else (self._plain, count)
        np.add(total, weight // 2, out=self._buffer)
        np.floor_divide(self._buffer, weight, out=self._buffer)
        return self._buffer.astype(np.uint8)
