"""Where episodes are driven: guarded child processes, and executors that keep many of them busy."""
