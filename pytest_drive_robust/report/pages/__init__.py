"""Writes a run as a folder of static pages that a browser opens by double click: no network, no server, no build step.

`episodes`, `evidence`, `compared`, `motion` and `report.road_map` turn a run (`report.run_records`) into plain data.
`run_data` collects the data in one document, and `folder` writes the document beside the scripts, the styles and the
page. The scripts insert all data of a run as text, never as markup.
"""
