"""A run as a folder of static pages that a browser opens by double click: no network, no server, no build step.

`records` brings a run's document and its stored episodes together; `episodes`, `evidence`, `compared`, `road_map` and
`motion` turn them into plain data, `run_data` puts these in one document, and `folder` writes it beside the scripts,
the styles and the page. Everything that a browser shows is put in as text by the scripts: nothing of a run is markup.
"""
