"""What decides how an episode ends, as one digest.

`identity` names all of it but route, setting and seed: agent, simulator, options, our own code. `object_code` tells
what a factory or a class is, `source_files` which files that lies in; `canonical_text` is equal for equal values.
"""
