"""What decides how an episode ends, as one digest; `identity` names all of it but route, setting and seed."""
