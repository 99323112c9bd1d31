"""The pages of a real run in Chromium: views, filters, links, keyboard, sizes, accessibility."""

from __future__ import annotations

import json
from importlib import resources

import pytest
from made_up_pages import HIT, LATENCY, report_of, text
from report_pages import AGENT, EPISODE, REQUIREMENT, VIEWS, data_of
from result_factory import make_result, scored

from pytest_drive_robust.report.numbers import ends_text, shown_beside
from pytest_drive_robust.verdict.explain import seconds_text

pytestmark = pytest.mark.slow


def test_any_red_requirement_leads_to_its_moment_in_two_clicks(opened):
    report = opened()
    page = report.go()
    assert "broken" in text(page)
    report.follow(page.locator("tr", has=page.locator(".badge.fail")).first.locator("th a"))
    assert "fail" in text(page)
    report.follow(page.locator(".cards a").first)
    page.wait_for_selector("canvas")
    assert page.evaluate("location.hash").startswith(f"#/episode/{AGENT}/")
    assert page.locator(".pane").count() == 2


def test_the_overview_shows_every_setting_and_what_was_chosen(opened):
    report = opened()
    page = report.go()
    assert page.locator(".matrix tbody tr").count() == len(data_of(report.folder)["rows"])
    page.get_by_role("link", name="RD", exact=True).click()
    report.until("document.querySelectorAll('.matrix thead th').length === 2")
    assert page.locator(".matrix thead th").all_inner_texts() == ["setting", "follower:Follower"]
    report.follow(page.locator(".matrix tbody td a").first)
    assert text(page) == "Episodes"
    assert "agent=" in page.evaluate("location.hash")


def test_the_overview_opens_episodes_with_the_worst_first(opened, tmp_path):
    clean = [scored("101", 20.0), scored("301", 100.0), scored("501", 90.0)]
    late = [scored(name, score, setting=LATENCY) for name, score in (("101", 20.0), ("301", 70.0), ("501", 30.0))]
    report = opened(report_of(tmp_path, *clean, *late))
    for setting, order, words in (
        ("clean", ["101", "501", "301"], "the lowest driving score (DS)"),
        (LATENCY, ["501", "301", "101"], "the largest loss of driving score (DS) against clean"),
    ):
        row = report.go().locator(".matrix tbody tr", has_text=setting)
        page = report.follow(row.locator("td a").first)
        assert page.locator("table.episodes td.route").all_inner_texts() == order
        assert page.get_by_text(f"The worst first: {words}").is_visible()
        page.locator("button.sort", has_text="route").click()
        assert page.locator("table.episodes td.route").all_inner_texts() == sorted(order)
        assert page.get_by_text("The worst first").is_hidden()


def test_failures_are_counted_by_setting_and_open_their_episodes(opened):
    report = opened()
    page = report.go("#/failures")
    run = data_of(report.folder)
    broken = sum(len(cluster["episodes"]) for cluster in run["clusters"])
    assert text(page).startswith(f"{broken} episodes went wrong")
    cell = page.locator("td.heat a").first
    count = int(cell.inner_text())
    report.follow(cell)
    assert page.locator("table.episodes tbody tr").count() == count
    page.go_back()
    page.wait_for_selector("table.tall")
    report.follow(page.locator("table.tall tbody th a").first)
    assert page.locator("table.episodes tbody tr").count() == len(run["clusters"][0]["episodes"])


def test_searching_and_filtering_keep_their_place_in_the_link(opened):
    report = opened()
    page = report.go("#/episodes")
    assert page.locator("table.episodes tbody tr").count() == 8
    page.get_by_label("Search").fill("opposite gps")
    page.locator("select[name=setting]").select_option("GPS noise 15 m")
    rows = page.locator("table.episodes tbody tr")
    found = rows.count()
    assert 0 < found < 8
    assert all("GPS noise 15 m" in row for row in rows.all_inner_texts())
    report.go(page.evaluate("location.hash"))
    assert page.locator("table.episodes tbody tr").count() == found
    assert page.get_by_label("Search").input_value() == "opposite gps"
    page.locator("button.sort", has_text="DS").last.click()
    scores = [float(word) for word in page.locator("tbody td.number:not(.twin):not(.driven)").all_inner_texts()]
    assert scores == sorted(scores)


def test_failures_are_told_as_shares_of_what_each_agent_drove_under_each_setting(opened, tmp_path):
    clean = [make_result(name, infractions=HIT if name == "101" else ()) for name in ("101", "301", "501", "701")]
    broken = make_result("101", setting=LATENCY, infractions=HIT)
    other = make_result("101", agent="other", infractions=HIT)
    page = opened(report_of(tmp_path, *clean, broken, other)).go("#/failures")
    assert page.locator("tr.driven td.number").all_text_contents() == ["3 of 6", "1 of 4", "1 of 1", "1 of 1"]
    assert page.locator("th.group").all_inner_texts() == ["driver", "other"]
    assert [head.get_attribute("title") for head in page.locator("th.turned").all()] == ["clean", LATENCY, "clean"]
    shades = [cell.evaluate("cell => cell.style.getPropertyValue('--share')") for cell in page.locator("td.heat").all()]
    assert shades == ["20%", "80%", "80%"]
    assert "driver" in page.locator("table.tall tbody tr:nth-child(2) td").nth(1).inner_text()


def test_failures_stand_under_the_agent_that_was_driven_later_and_comes_first_by_name(opened, tmp_path):
    driven = [make_result("101", agent="zoe"), make_result("101", agent="amy", infractions=HIT)]
    page = opened(report_of(tmp_path, *driven)).go("#/failures")
    assert page.locator("th.group").all_inner_texts() == ["amy", "zoe"]
    assert page.locator("tr.driven td.number").all_text_contents() == ["1 of 2", "1 of 1", "0 of 1"]


def test_episodes_of_several_agents_name_theirs(opened, tmp_path):
    results = [make_result("101", agent=name, infractions=HIT) for name in ("driver", "other")]
    report = opened(report_of(tmp_path, *results))
    page = report.go("#/failures")
    report.follow(page.locator("table.tall tbody th a").first)
    assert page.locator("table.episodes td.agent").all_inner_texts() == ["driver", "other"]


def test_a_second_is_rounded_as_in_the_terminal(opened):
    page = opened().go()
    times = [round(tick * 0.05, 2) for tick in range(2000)]
    assert page.evaluate("times => times.map(driveRobust.seconds)", times) == [seconds_text(time) for time in times]


def test_a_number_is_rounded_as_in_the_terminal(opened):
    page = opened().go()
    numbers = [place / 16 for place in range(1601)] + [place / 1000 for place in range(1001)]
    for decimals in range(4):
        shown = page.evaluate(
            "([all, places]) => all.map((one) => driveRobust.fixed(one, places))", [numbers, decimals]
        )
        assert shown == [f"{number:.{decimals}f}" for number in numbers]
    share = "[0.125, -0.125].map((value) => driveRobust.shownBeside(value, 0.12))"
    assert page.evaluate(share) == [shown_beside("SR", 0.125, 0.12), "\u22120.12"]
    ends = page.evaluate("driveRobust.between('RD', 0.3003, 0.3996, 0.30, 0.40)")
    assert ends == ends_text("RD", 0.3003, 0.3996, 0.30, 0.40) == "0.3003 to 0.3996"


def test_a_driving_score_is_rounded_once(opened, tmp_path):
    page = opened(report_of(tmp_path, scored("101", 36.2459))).go("#/episodes")
    assert text(page, "td[data-label=DS]") == "36.2"


def test_a_narrow_table_of_episodes_keeps_its_heads_and_is_sorted_by_them(opened):
    report = opened(width=400)
    page = report.go("#/episodes")
    page.locator("button.sort", has_text="DS").last.click()
    scores = [float(word) for word in page.locator("tbody td.number:not(.twin):not(.driven)").all_inner_texts()]
    assert scores == sorted(scores)
    label = "cell => getComputedStyle(cell, '::before').content"
    assert page.locator("tbody td.number:not(.twin):not(.driven)").first.evaluate(label) == '"DS "'
    assert page.locator("tbody td.route").first.evaluate(label) == '"route "'


@pytest.mark.parametrize("width", [400, 600, 800, 1280])
def test_no_word_of_a_plot_is_cut(opened, width):
    page = opened(width=width).go(REQUIREMENT)
    cut = """() => [...document.querySelectorAll("svg.chart")].flatMap((plot) => {
      const frame = plot.getBoundingClientRect();
      return [...plot.querySelectorAll("text")].filter((word) => {
        const box = word.getBoundingClientRect();
        return box.left < frame.left - 0.5 || box.right > frame.right + 0.5 || box.bottom > frame.bottom + 0.5;
      }).map((word) => word.textContent);
    })"""
    assert page.evaluate(cut) == []
    columns = page.evaluate(
        "getComputedStyle(document.querySelector('.columns')).gridTemplateColumns.split(' ').length"
    )
    assert columns == (2 if width > 1000 else 1)


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 768, 1280])
def test_every_view_fits_every_width(opened, width, scheme):
    report = opened(width=width, scheme=scheme)
    for view in VIEWS:
        page = report.go(view)
        assert page.evaluate("document.documentElement.scrollWidth") <= width, view
        shade = page.evaluate("getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)")
        assert (sum(shade) > 600) is (scheme == "light")


@pytest.mark.parametrize("width", [360, 390])
def test_four_tabs_stand_on_one_line_of_a_phone(opened, width):
    page = opened(width=width).go()
    tabs = page.locator("nav a")
    assert tabs.all_inner_texts() == ["Overview", "What went wrong", "Episodes", "Compare"]
    assert len({tab.bounding_box()["y"] for tab in tabs.all()}) == 1


def test_what_went_wrong_and_what_was_perturbed_have_words_of_their_own(opened):
    report = opened()
    for view in VIEWS:
        page = report.go(view)
        said = f"{page.title()} {page.evaluate('document.body.innerText')}".lower()
        assert "failure" not in said, view
        assert "failing" not in said, view


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_verdicts_have_other_colours_than_clean_and_perturbed_and_marks(opened, scheme):
    report = opened(scheme=scheme)
    page = report.go()
    names = "['clean', 'perturbed', 'clean-ink', 'perturbed-ink', 'good', 'bad', 'good-ink', 'bad-ink', 'error']"
    root = "getComputedStyle(document.documentElement)"
    colours = page.evaluate(f"{names}.map((name) => {root}.getPropertyValue(`--${{name}}`).trim())")
    assert len(set(colours)) == len(colours)
    assert page.locator(".bullet.fail .value").first.evaluate("dot => getComputedStyle(dot).fill") in (
        "rgb(125, 26, 94)",
        "rgb(243, 178, 222)",
    )
    page = report.go("#/episodes")
    mark = "cell => getComputedStyle(cell, '::after').content"
    assert page.locator("td.won").first.evaluate(mark).startswith('"\u2713"')
    assert page.locator("td.lost").first.evaluate(mark).startswith('"\u2717"')


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_what_lies_beyond_a_limit_is_seen_in_both_themes(opened, scheme):
    page = opened(scheme=scheme).go()
    shades = page.evaluate("""() => {
      const numbers = (words) => words.match(/[\\d.]+/g).map(Number);
      const { fill, opacity } = getComputedStyle(document.querySelector(".bullet .forbidden"));
      const under = numbers(getComputedStyle(document.body).backgroundColor);
      return [under, numbers(fill).map((value, at) => opacity * value + (1 - opacity) * under[at])];
    }""")
    dark, bright = sorted(luminance(shade) for shade in shades)
    assert (bright + 0.05) / (dark + 0.05) > 1.2


def luminance(rgb):
    """Return the relative luminance of WCAG 2 of a colour 0..255."""
    linear = [value / 3294.6 if value <= 10 else ((value / 255 + 0.055) / 1.055) ** 2.4 for value in rgb]
    return sum(share * value for share, value in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_no_fault(opened, scheme):
    axe = resources.files("axe_playwright_python").joinpath("axe.min.js").read_text(encoding="utf-8")
    report = opened(scheme=scheme)
    for view in VIEWS:
        page = report.go(view)
        page.evaluate(f"{axe}\n;0")
        found = page.evaluate("axe.run(document, { preload: false }).then(result => result.violations)")
        assert [(item["id"], [node["html"] for node in item["nodes"]][:3]) for item in found] == [], view


def test_the_keyboard_reaches_the_content_first_and_the_theme_is_switched(opened):
    page = opened().go()
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.className") == "skip"
    before = page.evaluate("getComputedStyle(document.body).backgroundColor")
    page.locator("#theme").click()
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") != before


def test_it_prints_without_what_only_a_screen_needs(opened):
    page = opened().go(EPISODE)
    page.emulate_media(media="print")
    assert not page.locator("nav").is_visible()
    controls = page.locator(".controls").locator("button, input, select")
    assert controls.count() > 4
    assert not any(control.is_visible() for control in controls.all())
    assert page.locator(".pane canvas").first.is_visible()
    assert page.locator(".clock").is_visible(), "the moment that the pictures show"


@pytest.mark.parametrize("view", VIEWS)
def test_nothing_is_cut_or_dark_on_paper(opened, view):
    page = opened(width=718, height=1000, scheme="dark").go(view)  # A4 without its margins
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print", color_scheme="dark")
    shade = page.evaluate("getComputedStyle(document.body).color.match(/\\d+/g).map(Number)")
    assert sum(shade) < 200, "dark ink"
    assert page.locator("details:not([open])").count() == 0
    widths = "[...document.querySelectorAll('main table')].map((item) => item.offsetWidth)"
    assert max(page.evaluate(widths), default=0) <= 718
    page.emulate_media(media="screen", color_scheme="dark")
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.evaluate("document.documentElement.dataset.theme ?? null") is None


def test_the_link_to_the_content_leads_there_and_not_to_another_view(opened):
    page = opened().go("#/episodes")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "main"
    assert text(page) == "Episodes"


def test_who_chooses_a_metric_by_keyboard_goes_on_from_there(opened):
    report = opened()
    page = report.go()
    page.get_by_role("link", name="RD", exact=True).focus()
    page.keyboard.press("Enter")
    report.until("document.querySelectorAll('.matrix thead th').length === 2")
    assert page.evaluate("document.activeElement.textContent") == "RD"


def test_what_is_not_there_says_so(opened):
    report = opened()
    assert text(report.go("#/nowhere")) == "There is no such view"
    assert text(report.go(f"#/episode/{AGENT}/clean/0/0")) == "No such episode"
    assert text(report.go("#/requirement/a/b")) == "No such requirement"


def test_a_folder_without_its_data_says_what_is_missing(browser, reports, tmp_path):
    (tmp_path / "index.html").write_bytes((reports / "now" / "index.html").read_bytes())
    (tmp_path / "static").symlink_to(reports / "now" / "static")
    page = browser.new_page()
    page.goto((tmp_path / "index.html").as_uri())
    page.wait_for_selector("h1")
    assert text(page) == "The data is not there"
    page.close()


def test_the_verdicts_are_there_without_scripts(reports):
    page = (reports / "now" / "index.html").read_text(encoding="utf-8")
    for item in json.loads((reports / ".drive-robust" / "runs" / "now.json").read_text())["requirements"]:
        assert (
            f"<td>{item['verdict']}</td><td>{item['requirement'].replace('<', '&lt;').replace('>', '&gt;')}</td>"
            in page
        )
