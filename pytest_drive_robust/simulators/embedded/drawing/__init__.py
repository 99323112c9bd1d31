"""How the embedded world is drawn; `camera.py` and `bev.py` beside this folder use it.

- `paint`, `texture`: the ground from above, as colours in levels of falling resolution
- `boxes`, `looks`, `furniture`: everything that stands on the ground, made of boxes
- `air`: light and visibility in a weather
- `canvas`: what the kernels are given, and the memory that they draw in; `packed`: colours as numbers
- `entry_points`: a picture. `assemble` makes boxes of the actors, `raster` and `faces` find what each pixel shows,
  `ground` and `sampling` draw sky and ground, `shadows` darken it, `shade` and `patterns` colour what stands on it,
  `street_lamps` light the road, `lens` draws rain, drops and glare
"""
