"""Bench2Drive and CARLA: official agents here, our failures there, official result files."""
