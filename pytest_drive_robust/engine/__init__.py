"""Drives episodes in worker processes: a supervisor watches each process, and an executor keeps many of them busy."""
