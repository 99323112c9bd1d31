"""Data, training and evaluation of the learned agents: `python -m drive_robust_agents.training COMMAND`.

Each command is a module here; `data/` makes data sets, `recipes/` says what each agent learns, `loop/` trains.
Collecting needs no torch. Nothing of this is imported when an agent drives.
"""
