"""A run as a folder of static pages that a browser opens by double click: no network, no server, no build step.

`episodes`, `evidence`, `compared`, `motion` and `report.road_map` turn a run (`report.run_records`) into plain data,
`run_data` puts these in one document, and `folder` writes it beside the scripts, the styles and the page. Everything
that a browser shows is put in as text by the scripts: nothing of a run is markup.
"""
