"""Readings: the two ways in which the failures of Bench2Drive-Robust can be read, as presets of their switches.

The paper states equations; its numbers were produced by a wrapper that does something else in places. `paper` is the
first and the default, `released` the second. A reading sets the switches that nobody said, fields of the failure:

=================== ================================================== ==============================================
failure             `paper`                                            `released`
=================== ================================================== ==============================================
inference latency   `mode=fifo`: the agent is asked in every tick, its `mode=hold`: it is asked once, its command is
                    command is applied `d` ticks later, so a command   applied `d` ticks later, and only then is it
                    is `d` ticks old                                   asked again: `d` to `2d - 1` ticks old
                    `warmup_ticks=0`                                   `warmup_ticks=20`: so long the commands are
                                                                       neutral, under the clean baseline as well
measured latency    `warmup_ticks=0`                                   `warmup_ticks=20`
burst frame drop    `length=fixed`: a burst lasts `length_s`           `length=uniform`: 2 ticks up to `length_s`
partial observation nothing: the text says "mask ratio", not of what,  `area=false`: the ratio of each side, so that
                    and unsaid it is that of each side                 0.5 covers a quarter of the image
GPS noise           the same in both
speed noise         the same in both
sensor delay        not in the paper's text, the same in both
frame blend         not in the paper's text, the same in both
=================== ================================================== ==============================================

What no switch tells apart is done in one way under either reading; each class says in which. One observation a tick
(the released wrapper perturbs twice). Draws keyed by route and seed (its are not). A mask that is drawn on top of a
frozen image (it freezes the masked one). A clean baseline with the warm-up of the setting (its has none, so that the
warm-up counts as degradation). A black mask (its code blurs unless it is told `occlusion`, which is what the rows of
the paper's table are called).

A reading is asked for by the brackets of a sentence, `"200 ms latency (reading=released)"`, by the marker
`drive_robust(reading="released")`, or by `--drive-reading`; who is nearest to the failure wins. A switch that was said
and that the reading has otherwise is refused. In a sentence `reading=released` stands for the switches that it sets.
"""

from __future__ import annotations

from dataclasses import dataclass

from pytest_drive_robust.errors import UnknownNameError

READINGS = ("paper", "released")
"""Every reading, the default first."""


@dataclass(frozen=True, slots=True)
class DriveReading:
    """A reading that somebody asked for. `asked` says where, as a message quotes it: `"--drive-reading released"`.

    Raises `UnknownNameError` for a name that is none of `READINGS`.
    """

    name: str
    asked: str

    def __post_init__(self) -> None:
        if self.name not in READINGS:
            raise UnknownNameError.of("reading", self.name, READINGS, hint=f"It was asked for by {self.asked}.")
