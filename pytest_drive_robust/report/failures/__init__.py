"""Finds by rules what went wrong in episodes, and groups the episodes under one short sentence.

`moment` finds what went wrong first, when, and what the ego was doing then; `clusters` groups episodes by both. Nothing
here decides a score.
"""
