"""The committed sample of a report is what the pages are today, and small.

The command of the README that writes one is run by `tests/readme/test_readme_snippets.py`.
"""

from __future__ import annotations

from pathlib import Path

from report_pages import data_of

from pytest_drive_robust.report.pages.episodes import EpisodeTable

ROOT = Path(__file__).parents[2]
SAMPLE = ROOT / "docs" / "extra" / "sample-report"
STATIC = ROOT / "pytest_drive_robust" / "report" / "pages" / "static"


def test_its_scripts_and_styles_are_those_of_the_package():
    told = f"cp {STATIC.relative_to(ROOT)}/* {SAMPLE.relative_to(ROOT)}/static/"
    for folder, other in ((STATIC, SAMPLE / "static"), (SAMPLE / "static", STATIC)):
        for file in folder.iterdir():
            assert (other / file.name).read_bytes() == file.read_bytes(), told


def test_its_data_is_of_the_paper_suite_and_complete():
    run = data_of(SAMPLE)
    assert set(EpisodeTable.COLUMNS) < set(run["episodes"]), "docs/gallery/report.md says how to make it again"
    assert len(run["requirements"]) == 12
    broken = [stated["requirement"] for stated in run["requirements"] if stated["verdict"] == "fail"]
    assert broken == ["RD under GPS noise 15 m <= 0.30"], "the one that docs/gallery/report.md and README.md speak of"
    assert all((SAMPLE / "data" / f"route-{place}.js").is_file() for place in range(len(run["routes"])))
    assert all(run["episodes"]["trace"])


def test_it_is_small():
    assert sum(file.stat().st_size for file in SAMPLE.rglob("*") if file.is_file()) < 2e6
