"""Bench2Drive and CARLA: official agents in our simulators, our failures in the official evaluator, result files."""
