"""From what a run asks for to finished episodes."""
