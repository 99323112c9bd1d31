"""Readings: the two ways in which the failures of Bench2Drive-Robust can be read, as presets of their switches.

The paper states equations, but a wrapper that differs from these equations in places produced its numbers. `paper`, the
default, follows the equations, `released` the wrapper. Switches are fields of a failure; a reading sets every switch
that the caller did not give:

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

Where the paper and the released code differ without a switch, both readings do the same, as each class says. Each tick
has one observation (the released wrapper perturbs twice). Draws are keyed by route and seed (in the released code they
are not). A mask is drawn on top of a frozen image (the released code freezes the masked image). The clean baseline has
the warm-up of the setting (the released baseline has none, so that the warm-up counts as degradation). A mask is black
(the released code blurs unless told `occlusion`, the name of the rows in the paper's table).

Ask for a reading in the brackets of a sentence, `"200 ms latency (reading=released)"`, by the marker
`drive_robust(reading="released")`, or by `--drive-reading`; the place nearest to the failure wins. A switch that is
given with another value than the reading has is refused. In a sentence `reading=released` stands for its switches.
"""

from __future__ import annotations

from dataclasses import dataclass

from pytest_drive_robust.errors import UnknownNameError

READINGS = ("paper", "released")
"""Every reading, the default first."""


@dataclass(frozen=True, slots=True)
class DriveReading:
    """A reading that the user asked for. `asked` tells where, as messages quote it: `"--drive-reading released"`.

    Raises `UnknownNameError` for a name that is not in `READINGS`.
    """

    name: str
    asked: str

    def __post_init__(self) -> None:
        if self.name not in READINGS:
            raise UnknownNameError.of("reading", self.name, READINGS, hint=f"It was asked for by {self.asked}.")
