"""The car of every agent: `mkz` itself, and `plain_car` for controllers that were tuned for another car."""
