"""Drives many episodes at once: their closed loops in lockstep."""
