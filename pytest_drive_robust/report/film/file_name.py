"""The name of a film, by which a report finds it again."""

from __future__ import annotations

import hashlib
import re

from pytest_drive_robust.domain.episode import Episode

_LONGEST_WORDS = 100
"""Stacks of many failures are long sentences."""


def film_name(episode: Episode) -> str:
    """Return the file name of a film, another one for each episode. It is ASCII and in small letters.

    Its words are for people. What they leave out (signs, letters of other alphabets, where one part ends) the digest
    tells apart.

    >>> film_name(Episode("my_agent:MyAgent", "603", "GPS noise 5 m", 0))
    'replay-my_agent-myagent-603-gps-noise-5-m-seed0-1545d8.mp4'
    """
    parts = (episode.agent, episode.route_id, episode.setting, f"seed{episode.seed}")
    words = re.sub(r"[^a-z0-9_.]+", "-", "-".join(parts).lower())[:_LONGEST_WORDS].strip("-")
    digest = hashlib.blake2b("\0".join(parts).encode("utf-8", "surrogatepass"), digest_size=3).hexdigest()
    return f"replay-{words}-{digest}.mp4"
