"""Why episodes broke, in a few words that many of them share, found from their records by rules.

`moment` says what went wrong first, when, and what the ego was doing then; `clusters` groups episodes by both. Nothing
here decides a score.
"""
