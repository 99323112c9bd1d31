"""The closed loop of many episodes at once."""
