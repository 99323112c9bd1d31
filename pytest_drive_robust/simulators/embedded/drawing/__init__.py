"""How the embedded world is drawn: ground texture, boxes, light. `camera.py` and `bev.py` beside this folder use it."""
