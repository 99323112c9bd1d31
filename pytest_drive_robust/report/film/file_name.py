"""The file name of a film, by which a report finds the film of an episode."""

from __future__ import annotations

import hashlib
import re

from pytest_drive_robust.domain.episode import Episode

_LONGEST_WORDS = 100
"""The most characters of words in a file name: the sentence of a large stack is long."""


def film_name(episode: Episode) -> str:
    """Return the file name of an episode's film, unique for each episode, in ASCII and small letters.

    The words are for people. The digest distinguishes episodes that differ only in what the words leave out: signs,
    letters of other alphabets, the borders between parts.

    >>> film_name(Episode("my_agent:MyAgent", "603", "GPS noise 5 m", 0))
    'replay-my_agent-myagent-603-gps-noise-5-m-seed0-1545d8.mp4'
    """
    parts = (episode.agent, episode.route_id, episode.setting, f"seed{episode.seed}")
    words = re.sub(r"[^a-z0-9_.]+", "-", "-".join(parts).lower())[:_LONGEST_WORDS].strip("-")
    digest = hashlib.blake2b("\0".join(parts).encode("utf-8", "surrogatepass"), digest_size=3).hexdigest()
    return f"replay-{words}-{digest}.mp4"
