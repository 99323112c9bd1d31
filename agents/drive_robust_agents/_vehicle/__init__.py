"""The car that every agent drives: `mkz` itself, `plain_car` for controllers whose numbers were found for another."""
