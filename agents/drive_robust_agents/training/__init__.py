"""Data, training and evaluation of the learned agents: `python -m drive_robust_agents.training collect|train|evaluate`.

Collecting needs no torch. Nothing of this is imported when an agent drives.
"""
