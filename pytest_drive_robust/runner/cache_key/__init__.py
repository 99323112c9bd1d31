"""What decides how an episode ends, as one digest."""
