"""Scores of finished episodes: each module holds one metric; nothing heavy is imported until a trace is filtered."""
