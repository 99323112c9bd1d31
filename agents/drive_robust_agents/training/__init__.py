"""Data, training and evaluation of the learned agents: `python -m drive_robust_agents.training COMMAND`.

Each command is a module here; `data/` makes data sets, `recipes/` defines the training of each agent, `loop/` trains.
Collecting needs no torch. No agent imports this package when driving.
"""
