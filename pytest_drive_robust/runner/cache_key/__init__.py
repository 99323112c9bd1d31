"""Computes an episode's key: a digest of all that decides its end. `identity` covers all but route, setting, seed."""
