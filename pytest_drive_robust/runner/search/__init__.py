"""Searches over severities, stacks and repetitions."""
