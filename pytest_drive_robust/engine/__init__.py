"""Where episodes are driven: worker processes with a supervisor each, and executors that keep many of them busy."""
