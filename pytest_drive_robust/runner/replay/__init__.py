"""Drives an episode again and keeps what a film of it needs."""
