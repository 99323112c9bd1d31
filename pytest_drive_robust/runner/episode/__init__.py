"""The closed loop of one episode."""
